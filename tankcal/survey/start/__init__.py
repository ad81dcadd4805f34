"""Start values: where points and photographs are, before anything is adjusted."""
