"""Months of records: modes stored and followed, weather taken out, change told."""

from modalscope.monitoring.change import Alarm, Alarms, alarms
from modalscope.monitoring.history import History
from modalscope.monitoring.netcdf import read_history
from modalscope.monitoring.store import Store
from modalscope.monitoring.tracking import track
from modalscope.monitoring.tracks import Explained, Tracks, explain
from modalscope.monitoring.watch import Collected, collect, read_covariates
from modalscope.numerics.arguments import plain_methods

__all__ = [
    "Alarm",
    "Alarms",
    "Collected",
    "Explained",
    "History",
    "Store",
    "Tracks",
    "alarms",
    "collect",
    "explain",
    "read_covariates",
    "read_history",
    "track",
]

plain_methods(Alarm, Alarms, Explained, History, Store, Tracks)
