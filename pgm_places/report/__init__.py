"""Self-contained HTML reports, their charts and layers."""
