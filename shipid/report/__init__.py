"""Results as one page a ship builder can read: frames in, HTML and Markdown out."""

from shipid.report.content import Finding, ReportContent, Sentence, Snapshot
from shipid.report.page import write_report
from shipid.report.summary import write_summary

__all__ = ["Finding", "ReportContent", "Sentence", "Snapshot", "write_report", "write_summary"]
