"""From lifetimes to findings: rows of metrics, the paper's tables and its figures."""
