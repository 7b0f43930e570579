//! What is there to scan with: libraries, sensors, and why one cannot be used, in words for people who want to scan.
//!
//! USB devices are read from what the system knows ([`crate::usb`]), so that nothing is opened that somebody else uses. The
//! libraries are opened in a process of their own, as for scanning.

mod library;
mod sensor;

use std::path::{Path, PathBuf};

use rustix::fs::{Access, access};
use serde::Serialize;

use crate::source::Ability;
use crate::usb;
pub(crate) use library::driver_of;
pub use library::{LibraryFacts, Listed, Name};

/// Names a folder that stands for `/` where devices are looked for: tests set it.
const ROOT_VARIABLE: &str = "SCAN_USB_ROOT";

/// What was found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Look {
    /// The libraries that talk to sensors, found or not.
    pub libraries: Vec<Library>,
    /// The sensors, in the order of their USB ports.
    pub sensors: Vec<Sensor>,
}

/// A library that talks to sensors.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Library {
    /// Its name.
    pub name: &'static str,
    /// Which sensors it serves.
    pub serves: &'static str,
    /// The file it was found as.
    pub path: Option<String>,
    /// Its version, as far as it says.
    pub version: Option<String>,
    /// How to get it, where it was not found.
    pub advice: Option<String>,
}

/// A sensor that is plugged in.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Sensor {
    /// In words: "Kinect for Xbox 360 (model 1414)".
    pub model: String,
    /// Serial number, where it has one that tells it apart.
    pub serial: String,
    /// The USB port, as the system numbers it; empty where only its library knows of the sensor.
    pub port: String,
    /// The library that serves it.
    pub backend: &'static str,
    /// What opens it, where it can be opened.
    pub address: Option<String>,
    /// What it can do beyond frames, as far as its model tells.
    pub abilities: Vec<Ability>,
    /// What stands in the way, the worst first.
    pub problems: Vec<Problem>,
}

/// Something that stands in the way, or may.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Problem {
    /// Which kind.
    pub kind: ProblemKind,
    /// Whether the sensor cannot be used before it is solved.
    pub blocks: bool,
    /// What is wrong and what to do.
    pub text: String,
}

/// Kinds of problems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProblemKind {
    /// A Kinect of the second generation, which needs other software.
    SecondGeneration,
    /// Its camera does not appear: the power supply is missing.
    NoPower,
    /// The library that serves it is missing.
    LibraryMissing,
    /// This user may not use it.
    NoPermission,
    /// Another program uses it.
    Busy,
    /// A driver of the system holds it.
    KernelDriver,
    /// This is a virtual machine.
    VirtualMachine,
    /// It hangs on a USB 3 controller.
    Usb3,
}

impl Sensor {
    /// Whether nothing stands in its way.
    pub fn is_usable(&self) -> bool {
        self.address.is_some() && self.problems.iter().all(|problem| !problem.blocks)
    }

    /// What stands in its way, where something does.
    pub fn obstacle(&self) -> Option<&Problem> {
        self.problems.iter().find(|problem| problem.blocks)
    }
}

impl Look {
    /// Whether a sensor waits for the right to be used: the udev rules help.
    pub fn wants_permission(&self) -> bool {
        let mut problems = self.sensors.iter().flat_map(|sensor| &sensor.problems);
        problems.any(|problem| problem.kind == ProblemKind::NoPermission)
    }
}

/// Where the system says what is plugged in.
pub(crate) struct Places {
    pub(crate) usb: PathBuf,
    pub(crate) dev: PathBuf,
    pub(crate) machine: PathBuf,
    pub(crate) may_use: fn(&Path) -> bool,
}

impl Places {
    /// Below `/`, or below the folder that tests name.
    pub(crate) fn of_system() -> Self {
        let root = std::env::var_os(ROOT_VARIABLE).map_or_else(|| PathBuf::from("/"), PathBuf::from);
        Self::below(&root)
    }

    fn below(root: &Path) -> Self {
        Self {
            usb: root.join("sys/bus/usb/devices"),
            dev: root.join("dev"),
            machine: root.join("sys/class/dmi/id"),
            may_use: |node| access(node, Access::READ_OK | Access::WRITE_OK).is_ok(),
        }
    }

    /// The virtual machine that this is, by the name of its board; `None` on real ones.
    fn virtual_machine(&self) -> Option<String> {
        let says = |attribute| usb::text(&self.machine.join(attribute)).unwrap_or_default();
        let name = format!("{} {}", says("sys_vendor"), says("product_name"));
        let makers = ["VirtualBox", "VMware", "QEMU", "KVM", "Virtual Machine", "Parallels", "Xen"];
        makers.iter().any(|maker| name.contains(maker)).then(|| name.trim().to_owned())
    }
}

/// Looks for libraries and sensors.
pub fn look() -> Look {
    let (libraries, listed) = library::look();
    let sensors = sensor::look(&Places::of_system(), &libraries, &listed);
    Look { libraries, sensors }
}

#[cfg(test)]
mod tests;
