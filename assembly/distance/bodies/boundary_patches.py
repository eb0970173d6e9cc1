"""x"""
from assembly.distance.bodies.patch_blocks import PatchBlock
def boundary_patches(face, block):
    return []
