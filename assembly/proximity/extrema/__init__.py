"""Extremal pairs of two surfaces, curves or edges: equations, derivatives, Newton, and rates under motion."""
