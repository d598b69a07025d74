"""Images through detectors: thresholds fitted and judged, other programs beside ours, and what is said."""
