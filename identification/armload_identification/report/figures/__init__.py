"""Figures of reports and pictures: Matplotlib, and SVG inside a page."""
