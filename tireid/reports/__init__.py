"""The report.html that `tireid identify`, `compare`, `drive` and `demo` leave."""
