"""Many runs: wedges, and jobs for farm engines."""
