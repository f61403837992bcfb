"""The report: an identification as one HTML page, for somebody who was not there."""
