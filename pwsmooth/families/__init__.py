"""Statistics of large families: what a run of many elements counts and records as it goes."""

from ..definition.families.event_statistics import Activity, Histogram, SlipHistogram
from ..definition.families.recording import Recorder

__all__ = ["Activity", "Histogram", "Recorder", "SlipHistogram"]
