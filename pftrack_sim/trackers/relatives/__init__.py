"""The methods that Ko et al. 2012 compare theirs with (table 1)."""
