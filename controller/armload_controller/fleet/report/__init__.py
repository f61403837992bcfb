"""The report of many arms."""
