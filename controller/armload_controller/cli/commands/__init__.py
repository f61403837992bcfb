"""One command per file: options in, library calls, tables out."""
