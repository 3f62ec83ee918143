"""The native rollout: whole closed-loop episodes without the GIL. Domains use it, users need not."""

__all__: list[str] = []
