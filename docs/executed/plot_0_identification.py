"""
One identification in ten lines
===============================

Every method of the table takes the same path: data, problem, data matrix, factors, realization, modes. Here each stage of the library is
called by itself, on the hammer test of a beam that lies with the examples, and shows what it made.
"""

import matplotlib.pyplot as plt
import numpy as np

import modalscope as ms

# %%
# **1. Data**: what was measured, with names, units and the lines.
data = ms.datasets.load("beam_hammer")
lines, outputs, inputs = data.values.shape
print(f"{lines} lines x {outputs} accelerometers x {inputs} hammer points")
ms.plot.response(data, output=0, input=0)

# %%
# **2. Problem**: the data as a row of the table takes them. "alternate" takes lines in the band; `options` are its settings.
problem = ms.prepare(data, method="alternate", band=(100, 4500))
print(f"{problem.method.name} in {problem.method.domain}: {len(problem.response.frequencies)} lines in the band")

# %%
# **3. Data matrix**: rows are polynomials of the frequency times the response. It is never formed; products with it are all that is needed.
pipeline = ms.factor(problem, largest=40)
print(pipeline.matrix.describe())

# %%
# **4. Factors**: its leading singular vectors, computed once. Modes stand above the noise.
print(f"{pipeline.factors.d.size} singular values, {pipeline.factors.how}")
ms.plot.singular_values(pipeline.factors.spectrum)

# %%
# **5. Realization**: the model of any order is cut from the factors. This row reads A and C off them, and fits participation to the lines.
model = pipeline.triple(20)
print(f"A {model.A.shape}, C {model.C.shape}")
poles = pipeline.matrix.to_s(np.linalg.eigvals(model.A))
_, ax = plt.subplots()
ax.plot(poles.real, poles.imag / (2 * np.pi), "x")
ax.set(xlabel="real part (rad/s)", ylabel="imaginary part (Hz)", title="poles of order 20")

# %%
# **6. Modes**: eigenvalues of A are frequencies and damping ratios, its eigenvectors seen through C are shapes. `sweep` yields one order
# after the other.
(cut,) = ms.sweep(pipeline, orders=[20])
for f, zeta in zip(cut.modes.frequencies, cut.modes.damping_ratios):
    print(f"{f:8.1f} Hz  {100 * zeta:6.2f} %")
print(f"fit error {100 * cut.misfit:.1f} %")

# %%
# **7. Diagram**: all orders, each pole judged against the order before.
diagram = ms.stabilize(pipeline, orders=range(2, 41, 2))
ms.plot.stabilization(diagram)

# %%
# **8. Selection**: which poles are modes, each with its reason.
modes = ms.select(diagram)
for f, zeta, why in zip(modes.frequencies, modes.damping_ratios, modes.reasons):
    print(f"{f:8.1f} Hz  {100 * zeta:5.2f} %  {why['text']}")

# %%
# **9. Check**: the response is rebuilt from the modes.
ms.plot.response(problem.response, modes, output=0, input=0)

# %%
# **The plain path**: all of this but the report runs by sixteen short modules, which ARCHITECTURE lists in the order of reading. What structure
# makes faster stands beside them and gives the same.
from modalscope.identification.prepare import prepare
from modalscope.identification.stabilize import stabilized
from modalscope.numerics.handed import plain_steps

with plain_steps():
    plain = stabilized(prepare(data, method="alternate", band=(100, 4500)), list(range(2, 41, 2)))
print(f"poles by plain steps: {np.abs(plain.poles / diagram.poles - 1).max():.0e} from those above")

# %%
# **10. Report**: one file with tables and pictures, for those who were not there.
page = ms.report((modes, diagram), "beam.html")
print(f"{page.name}: {page.stat().st_size // 1000} kB")
page.unlink()
