"""The report that people send: one HTML file, with no need of a network.

condyle.report.page.write_report(solution, "report.html")
"""

from .report_page import report_html, write_report

__all__ = ["report_html", "write_report"]
