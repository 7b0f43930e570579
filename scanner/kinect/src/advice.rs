//! What to do about it, in words for people who want to scan a product: shared by drivers and [`crate::probe`].

/// How to get libfreenect.
pub const INSTALL_FREENECT: &str = "install it with `sudo apt install libfreenect0.5` (Debian, Ubuntu), \
     `sudo dnf install libfreenect` (Fedora) or `brew install libfreenect` (macOS)";

/// How to get OpenNI2.
pub const INSTALL_OPENNI2: &str = "install it with `sudo apt install libopenni2-0` (Debian, Ubuntu) or \
     `sudo dnf install openni` (Fedora); it serves Asus Xtion and PrimeSense sensors and .oni files, not the Kinect";

/// The udev rules, to copy.
pub const UDEV_RULES: &str = include_str!("../../../deploy/60-allround-kinect.rules");

/// Where they go.
pub const UDEV_PATH: &str = "/etc/udev/rules.d/60-allround-kinect.rules";

/// You may not use it.
pub const NO_PERMISSION: &str = "you may not use this USB device yet: `scan-product devices` prints a rule to copy into \
     /etc/udev/rules.d; then unplug the sensor and plug it in again";

/// Somebody else does.
pub const BUSY: &str =
    "another program is using it: close that program, or unplug the sensor and plug it in again";

/// The camera does not answer as it should.
pub const NO_ANSWER: &str = "the camera does not answer: unplug it, plug it into another USB 2 port (not through a hub), and \
     check that its own power supply is connected";
