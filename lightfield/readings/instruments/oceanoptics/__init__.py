"""Ocean Optics and Ocean Insight: text files of several programs in any language, and ProcSpec."""
