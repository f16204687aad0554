"""Results as one page a ship builder can read: frames in, HTML and Markdown out."""

from shipid.report.content import AnswerSentence, ReportContent, ReportFinding, WindowSnapshot
from shipid.report.sections import write_report
from shipid.report.summary import write_summary

__all__ = ["AnswerSentence", "ReportContent", "ReportFinding", "WindowSnapshot", "write_report", "write_summary"]
