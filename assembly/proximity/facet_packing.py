"""temporary"""
from __future__ import annotations
import numpy as np
from assembly.proximity import bounding_tree as bt

def pack_tree(tree, scale, table_at=0, pool_at=0):
    nodes = tree.nodes
    m = len(nodes.child); n = len(tree.feature)
    header = np.zeros(bt.TREE, dtype=np.int64)
    header[bt.NODES] = m; header[bt.NODE_TABLE] = table_at + bt.TREE
    header[bt.NODE_POOL] = pool_at; header[bt.ELEMENTS] = n
    header[bt.ELEMENT_POOL] = pool_at + bt.NODE * m
    ints = np.full((m, bt.NODE_INTS), -1, dtype=np.int64)
    ints[:, bt.CHILD] = nodes.child
    leaf = nodes.child < 0
    ints[leaf, bt.FEATURE] = tree.feature[-1 - nodes.child[leaf]]
    rows = np.zeros((m, bt.NODE))
    center = 0.5*(nodes.low+nodes.high)/scale; half = 0.5*(nodes.high-nodes.low)/scale
    half *= 1+1e-15
    rows[:, :3] = center; rows[:, 3:6] = half; rows[:, 6:9] = nodes.axis
    rows[:, bt.COS] = np.cos(nodes.half_angle); rows[:, bt.SIN] = np.sin(nodes.half_angle)
    rows[:, bt.RADIUS] = np.linalg.norm(half, axis=1)
    p = tree.parameters
    el = np.column_stack([0.5*(p[:,0]+p[:,1]), 0.5*(p[:,2]+p[:,3]), 0.5*(p[:,1]-p[:,0]), 0.5*(p[:,3]-p[:,2]), tree.feature])
    return np.concatenate([header, ints.ravel()]), np.concatenate([rows.ravel(), el.ravel()]), table_at
