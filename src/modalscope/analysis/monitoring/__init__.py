"""Months of records: modes stored and followed, weather taken out, change told."""

from modalscope.analysis.monitoring.change import Alarm, Alarms, alarms
from modalscope.analysis.monitoring.history import History, read_history
from modalscope.analysis.monitoring.store import Store
from modalscope.analysis.monitoring.tracking import track
from modalscope.analysis.monitoring.tracks import Explained, Tracks, explain
from modalscope.analysis.monitoring.watch import Collected, collect, read_covariates
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
