"""The causes: one file each, with its statistic, its null distribution, its extension and its words."""
