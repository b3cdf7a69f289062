"""Floor 1: block data matrices and their factors."""

from modalscope.blocks.factor import Factors, factorize
from modalscope.blocks.hankel import Hankel, hankel
from modalscope.blocks.matrix import DataMatrix, RowShift
from modalscope.blocks.projection import Projection, projection
from modalscope.blocks.transfer import Transfer, transfer

__all__ = [
    "DataMatrix",
    "Factors",
    "Hankel",
    "Projection",
    "RowShift",
    "Transfer",
    "factorize",
    "hankel",
    "projection",
    "transfer",
]
