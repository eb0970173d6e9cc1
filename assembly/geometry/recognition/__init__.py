"""What a surface is: a plane, a cylinder, a cone, a sphere, a torus, an extrusion, a revolution, or freeform."""
