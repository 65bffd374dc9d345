"""The only place that touches the private parts of viser, and the script that runs in the page."""
