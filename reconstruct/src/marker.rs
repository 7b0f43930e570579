//! Square markers: codes, detection, pose on the board.
