"""The studies of the search: every number of docs/performance.md on finding the minimum."""
