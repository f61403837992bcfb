"""Figures of reports and pictures: Matplotlib, and SVG that stands inside a page."""
