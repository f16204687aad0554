"""Results as one page a ship builder can read: frames in, HTML and Markdown out."""

from shipid.report.content import AnswerSentence, ReportContent, WindowSnapshot
from shipid.report.sections import write_report
from shipid.report.summary import summary_text

__all__ = ["AnswerSentence", "ReportContent", "WindowSnapshot", "summary_text", "write_report"]
