"""Reports of a diagnosis: text, HTML pages and figures."""
