"""How does a pilot do where others are measured? Suites, flights, scores, reports; in process, on the full vehicle."""
