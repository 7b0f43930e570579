//! `scan-product devices` on computers with nothing, a Kinect, and half a Kinect.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use super::support::{Ran, command};

/// A folder that stands for `/`.
struct Computer {
    root: TempDir,
}

impl Computer {
    fn new() -> Self {
        Self { root: tempfile::tempdir().unwrap() }
    }

    fn plug(&self, port: &str, product: &str, serial: &str) {
        let device = self.root.path().join("sys/bus/usb/devices").join(port);
        fs::create_dir_all(&device).unwrap();
        let attributes = [
            ("idVendor", "045e"),
            ("idProduct", product),
            ("bcdDevice", "010b"),
            ("serial", serial),
            ("busnum", "3"),
            ("devnum", "7"),
        ];
        for (attribute, value) in attributes {
            fs::write(device.join(attribute), format!("{value}\n")).unwrap();
        }
    }

    /// The file through which a program would use the device of [`Self::plug`].
    fn allow(&self) {
        let node = self.root.path().join("dev/bus/usb/003/007");
        fs::create_dir_all(node.parent().unwrap()).unwrap();
        fs::write(node, "").unwrap();
    }

    fn devices(&self, library: &Path, options: &[&str]) -> Ran {
        let mut command = command();
        command.env("SCAN_USB_ROOT", self.root.path()).env("SCAN_FREENECT_LIB", library);
        command.arg("devices").args(options).output().unwrap().into()
    }
}

/// A library that is none: these computers have no libfreenect, whatever this one has.
fn missing() -> &'static Path {
    Path::new("/nonexistent/libfreenect.so")
}

#[test]
fn nothing_plugged_in_and_no_library() {
    let ran = Computer::new().devices(missing(), &[]).with_status(0);
    assert!(ran.out.contains("none is plugged in"), "{}", ran.out);
    assert!(ran.out.contains("sudo apt install libfreenect0.5"), "{}", ran.out);
    assert_eq!(ran.err, "");
}

#[test]
fn a_kinect_that_nobody_may_use_yet() {
    let computer = Computer::new();
    computer.plug("3-1.3", "02ae", "A00366A08793039A");
    let ran = computer.devices(missing(), &[]).with_status(0);
    for words in [
        "A00366A08793039A",
        "cannot be used",
        "may not use this USB device",
        "/etc/udev/rules.d/60-allround",
        "uaccess",
    ] {
        assert!(ran.out.contains(words), "{words:?} is not in {}", ran.out);
    }
    let value: Value =
        serde_json::from_str(&computer.devices(missing(), &["--json"]).with_status(0).out).unwrap();
    let sensor = &value["sensors"][0];
    assert_eq!((&sensor["usable"], &sensor["serial"]), (&false.into(), &"A00366A08793039A".into()));
    let kinds: Vec<&str> =
        sensor["problems"].as_array().unwrap().iter().map(|p| p["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["library_missing", "no_permission"]);
    assert!(value["udev_rules"]["text"].as_str().unwrap().contains("02ae"));
}

#[test]
fn a_kinect_without_power_and_one_of_the_second_generation() {
    let computer = Computer::new();
    computer.plug("3-1.1", "02b0", "");
    computer.plug("3-2", "02c4", "");
    computer.allow();
    let ran = computer.devices(missing(), &[]).with_status(0);
    assert!(ran.out.contains("only its motor answers"), "{}", ran.out);
    assert!(ran.out.contains("second generation"), "{}", ran.out);
    // Rights would not help these.
    assert!(!ran.out.contains("udev"), "{}", ran.out);
}

/// What the program itself starts is not for people, and does no harm.
#[test]
fn the_driver_is_not_for_people() {
    let usages: [&[&str]; 5] =
        [&[], &["freenect"], &["freenect", "1", ""], &["freenect", "99", ""], &["nonsense", "3", "x"]];
    for arguments in usages {
        let ran: Ran = command().arg("__driver").args(arguments).output().unwrap().into();
        let ran = ran.with_status(2);
        assert!(ran.err.contains("started by the program itself"), "{arguments:?}: {}", ran.err);
    }
    let help: Ran = command().arg("--help").output().unwrap().into();
    assert!(!help.out.contains("__driver"));
}
