"""Reads what imud writes: measurements (load), summaries (load_summary), records (load_record); draws a run (plot)."""
import json

from .measurements import load
from .plots import plot
from .record import Interface, Packet, Record, load_record

__all__ = ["Interface", "Packet", "Record", "load", "load_record", "load_summary", "plot"]


def load_summary(path):
    """Returns the JSON of --summary (of run, replay, and replay with seeds) or of imu-decode --json as a dict."""
    with open(path, encoding="utf-8") as file:
        return json.load(file)
