"""x"""
def spine_row(block):
    return None
