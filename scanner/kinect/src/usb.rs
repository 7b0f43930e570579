//! What the system knows of the USB devices that are plugged in (Linux: `/sys/bus/usb/devices`), without touching them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::probe::Places;

/// Most devices that are looked at.
const MOST_DEVICES: usize = 1000;
/// Longest attribute that is read, bytes.
const MOST_TEXT: usize = 256;

/// Microsoft.
pub const MICROSOFT: u16 = 0x045e;
/// PrimeSense and the sensors that Asus makes with it.
pub const PRIMESENSE: u16 = 0x1d27;

/// One device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Device {
    /// The folder's name: `3-1.2`.
    pub name: String,
    /// Who made it.
    pub vendor: u16,
    /// What it is.
    pub product: u16,
    /// Its version, as digits of four bits.
    pub version: u16,
    /// Its serial number, where it has one.
    pub serial: String,
    /// The bus it is on.
    pub bus: u16,
    /// Its number on the bus.
    pub number: u16,
    /// Drivers of its interfaces: `usbfs` for a program that uses it.
    pub drivers: Vec<String>,
}

/// All devices below a folder like that, in order of their names; none where there is no such folder.
pub fn devices(folder: &Path) -> Vec<Device> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut names: Vec<String> = entries
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| !name.contains(':'))
        .take(MOST_DEVICES)
        .collect();
    names.sort();
    names.iter().filter_map(|name| device(folder, name)).collect()
}

fn device(folder: &Path, name: &str) -> Option<Device> {
    let home = folder.join(name);
    let hex = |attribute: &str| u16::from_str_radix(&text(&home.join(attribute))?, 16).ok();
    let decimal = |attribute: &str| text(&home.join(attribute))?.parse().ok();
    Some(Device {
        name: name.to_owned(),
        vendor: hex("idVendor")?,
        product: hex("idProduct")?,
        version: hex("bcdDevice").unwrap_or(0),
        serial: text(&home.join("serial")).unwrap_or_default(),
        bus: decimal("busnum").unwrap_or(0),
        number: decimal("devnum").unwrap_or(0),
        drivers: drivers(&home, name),
    })
}

/// Interfaces are folders named like the device with a colon; the link `driver` says who has it.
fn drivers(home: &Path, name: &str) -> Vec<String> {
    let Ok(entries) = fs::read_dir(home) else { return Vec::new() };
    let interface = format!("{name}:");
    let mut drivers: Vec<String> = entries
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&interface))
        .filter_map(|entry| fs::read_link(entry.path().join("driver")).ok())
        .filter_map(|link| Some(link.file_name()?.to_string_lossy().into_owned()))
        .collect();
    drivers.sort();
    drivers.dedup();
    drivers
}

/// The driver of the host controller that a bus belongs to: `xhci_hcd` is USB 3.
pub fn controller(folder: &Path, bus: u16) -> Option<String> {
    let root = fs::canonicalize(folder.join(format!("usb{bus}"))).ok()?;
    let link = fs::read_link(root.parent()?.join("driver")).ok()?;
    Some(link.file_name()?.to_string_lossy().into_owned())
}

/// An attribute, trimmed.
pub fn text(path: &Path) -> Option<String> {
    let bytes = fs::read(path).ok()?;
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(MOST_TEXT)]);
    // What a device says of itself goes to a terminal: no control characters.
    Some(text.trim().chars().filter(|c| !c.is_control()).collect())
}

impl Device {
    /// The file through which programs use it.
    pub fn node(&self, dev: &Path) -> PathBuf {
        dev.join(format!("bus/usb/{:03}/{:03}", self.bus, self.number))
    }

    /// Whether it is the camera of a Kinect of the first generation.
    pub fn is_kinect_camera(&self) -> bool {
        self.vendor == MICROSOFT && matches!(self.product, 0x02ae | 0x02bf)
    }

    /// Whether it is another part of such a Kinect: motor or microphones.
    pub fn is_kinect_part(&self) -> bool {
        self.vendor == MICROSOFT
            && matches!(self.product, 0x02ad | 0x02b0 | 0x02bb | 0x02be | 0x02c2 | 0x02c3)
    }

    /// Whether it belongs to a Kinect of the second generation.
    pub fn is_second_kinect(&self) -> bool {
        self.vendor == MICROSOFT && matches!(self.product, 0x02c4 | 0x02d8 | 0x02d9)
    }

    /// What people call it.
    pub fn model(&self) -> &'static str {
        match (self.vendor, self.product, self.version) {
            (MICROSOFT, 0x02ae, 0x010b) => "Kinect for Xbox 360 (model 1414)",
            (MICROSOFT, 0x02ae, 0) => "Kinect for Xbox 360",
            (MICROSOFT, 0x02ae, _) => "Kinect for Xbox 360 (model 1473)",
            (MICROSOFT, 0x02bf, _) => "Kinect for Windows (model 1517)",
            (MICROSOFT, 0x02c4 | 0x02d8 | 0x02d9, _) => "Kinect of the second generation",
            (PRIMESENSE, 0x0600 | 0x0601, _) => "Asus Xtion",
            (PRIMESENSE, _, _) => "PrimeSense sensor",
            _ => "unknown",
        }
    }
}

/// The model of the Kinect with this serial number, or of the only one.
pub fn kinect_model(serial: &str) -> String {
    let cameras: Vec<Device> =
        devices(&Places::of_system().usb).into_iter().filter(Device::is_kinect_camera).collect();
    let by_serial = cameras.iter().find(|camera| !serial.is_empty() && camera.serial == serial);
    let only = if cameras.len() == 1 { cameras.first() } else { None };
    by_serial.or(only).map_or("Kinect", Device::model).to_owned()
}
