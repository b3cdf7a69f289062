"""Months of records: modes stored and followed, weather taken out, change told."""

from modalscope.monitoring.history import History
from modalscope.monitoring.store import Store
from modalscope.monitoring.watch import Collected, collect, read_covariates
from modalscope.numerics.arguments import plain_methods

__all__ = ["Collected", "History", "Store", "collect", "read_covariates"]

plain_methods(History, Store)
