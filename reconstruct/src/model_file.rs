//! Model files: ASC, PLY, PCD and GLB, read with limits and written.
