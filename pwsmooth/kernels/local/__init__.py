"""Events of a family that cost their neighbourhood, not the system."""
