use super::ProblemKind::{Busy, KernelDriver, NoPermission, Usb3, VirtualMachine};
use super::*;
use std::fs;
use std::os::unix::fs::symlink;

use tempfile::TempDir;

/// A system with USB devices to look at.
struct System {
    home: TempDir,
    /// What OpenNI2 knows of.
    listed: Vec<Listed>,
}

impl System {
    fn new() -> Self {
        let system = Self { home: tempfile::tempdir().unwrap(), listed: Vec::new() };
        fs::create_dir_all(system.path("sys/bus/usb/devices")).unwrap();
        system
    }

    fn path(&self, below: &str) -> PathBuf {
        self.home.path().join(below)
    }

    fn device(&self, name: &str, product: u16, version: u16, serial: &str) -> PathBuf {
        self.device_of(usb::MICROSOFT, name, product, version, serial)
    }

    fn device_of(&self, vendor: u16, name: &str, product: u16, version: u16, serial: &str) -> PathBuf {
        let home = self.path(&format!("sys/bus/usb/devices/{name}"));
        fs::create_dir_all(&home).unwrap();
        let bus = name.split('-').next().unwrap();
        let hex = |value: u16| format!("{value:04x}\n");
        let attributes = [
            ("idVendor", hex(vendor)),
            ("idProduct", hex(product)),
            ("bcdDevice", hex(version)),
            ("serial", format!("{serial}\n")),
            ("busnum", format!("{bus}\n")),
            ("devnum", "7\n".into()),
        ];
        for (attribute, value) in attributes {
            fs::write(home.join(attribute), value).unwrap();
        }
        home
    }

    /// The driver of the device's first interface.
    fn driven_by(&self, name: &str, driver: &str) {
        let interface = self.path(&format!("sys/bus/usb/devices/{name}/{name}:1.0"));
        fs::create_dir_all(&interface).unwrap();
        symlink(format!("../../../../bus/usb/drivers/{driver}"), interface.join("driver")).unwrap();
    }

    fn controller(&self, bus: u16, driver: &str) {
        let controller = self.path(&format!("sys/devices/pci/{bus}"));
        fs::create_dir_all(controller.join(format!("usb{bus}"))).unwrap();
        symlink(format!("../drivers/{driver}"), controller.join("driver")).unwrap();
        symlink(controller.join(format!("usb{bus}")), self.path(&format!("sys/bus/usb/devices/usb{bus}")))
            .unwrap();
    }

    fn sensors(&self, may_use: fn(&Path) -> bool) -> Vec<Sensor> {
        let places = Places { may_use, ..Places::below(self.home.path()) };
        let there = |name| Library { name, serves: "", path: None, version: None, advice: None };
        sensor::look(&places, &[there("libfreenect"), there("OpenNI2")], &self.listed)
    }
}

fn kinds(sensor: &Sensor) -> Vec<ProblemKind> {
    sensor.problems.iter().map(|problem| problem.kind).collect()
}

#[test]
fn an_xbox_kinect_with_all_its_parts() {
    let system = System::new();
    system.device("3-1.1", 0x02b0, 0x0105, "");
    system.device("3-1.2", 0x02ad, 0x0105, "A44886D15174038A");
    system.device("3-1.3", 0x02ae, 0x010b, "A00366A08793039A");
    let [kinect] = &system.sensors(|_| true)[..] else { panic!("one Kinect is one sensor") };
    assert_eq!(kinect.model, "Kinect for Xbox 360 (model 1414)");
    assert_eq!(kinect.address.as_deref(), Some("freenect:A00366A08793039A"));
    assert!(kinect.abilities.contains(&Ability::Tilt) && kinect.is_usable() && kinect.problems.is_empty());
}

#[test]
fn later_models_and_serial_numbers_of_zeros() {
    let system = System::new();
    system.device("1-1.3", 0x02ae, 0x0303, "0000000000000000");
    system.device("2-1.3", 0x02bf, 0x0108, "0000000000000000");
    let sensors = system.sensors(|_| true);
    let said: Vec<_> = sensors.iter().map(|s| (s.model.as_str(), s.address.as_deref().unwrap())).collect();
    assert_eq!(
        said,
        [
            ("Kinect for Xbox 360 (model 1473)", "freenect:#1"),
            ("Kinect for Windows (model 1517)", "freenect:#2")
        ]
    );
    assert!(
        sensors.iter().all(|sensor| !sensor.abilities.contains(&Ability::Tilt) && sensor.serial.is_empty())
    );
}

#[test]
fn only_the_motor_answers() {
    let system = System::new();
    system.device("3-1.1", 0x02b0, 0x0105, "");
    system.device("3-1.2", 0x02ad, 0x0105, "");
    let [sensor] = &system.sensors(|_| true)[..] else { panic!("both parts are one Kinect") };
    assert_eq!((kinds(sensor), sensor.is_usable()), (vec![ProblemKind::NoPower], false));
    assert!(sensor.problems[0].text.contains("power supply"));
}

#[test]
fn the_second_generation_and_others() {
    let system = System::new();
    system.device("3-1", 0x02c4, 0x0100, "");
    system.device_of(usb::PRIMESENSE, "3-2", 0x0601, 0x0001, "");
    system.device_of(0x046d, "3-3", 0x0825, 0x0001, "a webcam");
    let [second, xtion] = &system.sensors(|_| true)[..] else { panic!("a webcam is no sensor") };
    assert_eq!((kinds(second), second.is_usable()), (vec![ProblemKind::SecondGeneration], false));
    assert_eq!((xtion.address.as_deref(), xtion.is_usable()), (Some("openni2"), true));
}

#[test]
fn every_sensor_of_openni2_has_an_address_of_its_own() {
    let mut system = System::new();
    for name in ["2-1", "3-1"] {
        system.device_of(usb::PRIMESENSE, name, 0x0601, 0x0001, "");
    }
    let listed = |uri: &str, usb| Listed { uri: uri.into(), vendor: "A\u{1b}".into(), name: "B".into(), usb };
    system.listed = vec![
        listed("1d27/0601@2/7", (0x1d27, 0x0601)),
        listed("1d27/0601@3/7", (0x1d27, 0x0601)),
        listed("2bc5/0401@3/8", (0x2bc5, 0x0401)),
        listed("freenect://0", (usb::MICROSOFT, 0x02ae)),
    ];
    let sensors = system.sensors(|_| true);
    let addresses: Vec<&str> = sensors.iter().filter_map(|sensor| sensor.address.as_deref()).collect();
    assert_eq!(addresses, ["openni2:2bc5/0401@3/8", "openni2:1d27/0601@2/7", "openni2:1d27/0601@3/7"]);
    assert_eq!((sensors[0].model.as_str(), sensors[0].is_usable()), ("A B", true));
    // Where the library lists nothing, what the USB says must do.
    system.listed.clear();
    assert_eq!(system.sensors(|_| true)[1].address.as_deref(), Some("openni2:1d27/0601@3/7"));
}

#[test]
fn what_stands_in_the_way() {
    let system = System::new();
    system.device("3-1.3", 0x02ae, 0x010b, "A0");
    system.driven_by("3-1.3", "gspca_kinect");
    system.controller(3, "xhci_hcd");
    fs::create_dir_all(system.path("sys/class/dmi/id")).unwrap();
    fs::write(system.path("sys/class/dmi/id/product_name"), "VirtualBox\n").unwrap();
    let [sensor] = &system.sensors(|_| true)[..] else { panic!() };
    assert_eq!((kinds(sensor), sensor.is_usable()), (vec![KernelDriver, VirtualMachine, Usb3], true));
    system.device("4-1", 0x02ae, 0x010b, "B0");
    system.driven_by("4-1", "usbfs");
    let sensors = system.sensors(|node| node.ends_with("dev/bus/usb/004/007"));
    assert_eq!(kinds(&sensors[0])[0], NoPermission);
    assert_eq!((kinds(&sensors[1])[0], sensors[1].is_usable()), (Busy, false));
    let look = Look { libraries: vec![], sensors };
    assert!(look.wants_permission());
}

#[test]
fn names_from_devices_do_no_harm() {
    let system = System::new();
    let home = system.device("3-1", 0x02ae, 0x010b, "A\u{1b}[31m\0B");
    fs::write(home.join("busnum"), "not a number").unwrap();
    fs::write(system.path("sys/bus/usb/devices/no-device"), "a file").unwrap();
    let [sensor] = &system.sensors(|_| true)[..] else { panic!() };
    assert_eq!(sensor.serial, "A[31mB");
    assert!(Places::below(Path::new("/nonexistent")).virtual_machine().is_none());
    assert!(usb::devices(Path::new("/nonexistent")).is_empty());
}

#[test]
fn a_missing_library_says_how_to_get_it() {
    let system = System::new();
    system.device("3-1", 0x02ae, 0x010b, "A0");
    let missing = Library {
        name: "libfreenect",
        serves: "",
        path: None,
        version: None,
        advice: Some("install it".into()),
    };
    let places = Places { may_use: |_| true, ..Places::below(system.home.path()) };
    let sensors = sensor::look(&places, &[missing], &[]);
    assert_eq!(kinds(&sensors[0]), [ProblemKind::LibraryMissing]);
    assert!(sensors[0].obstacle().unwrap().text.contains("install it"));
}
