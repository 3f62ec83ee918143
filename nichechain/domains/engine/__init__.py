"""The native rollout: whole closed-loop episodes without the GIL."""
