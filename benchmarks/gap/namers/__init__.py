"""Those who name: baselines that must fail, and the workflow."""
