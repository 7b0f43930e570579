//! The sensors on the USB bus and what stands in their way.

use super::{Library, Listed, Places, Problem, ProblemKind, Sensor};
use crate::advice;
use crate::source::Ability;
use crate::usb::{self, Device, MICROSOFT, PRIMESENSE};

/// The driver of a program that uses a device.
const PROGRAM: &str = "usbfs";
/// The driver of USB 3 controllers.
const USB3: &str = "xhci_hcd";
/// What the motor of an Xbox Kinect answers as.
const MOTOR: u16 = 0x02b0;

/// All sensors.
pub(super) fn look(places: &Places, libraries: &[Library], listed: &[Listed]) -> Vec<Sensor> {
    let devices = usb::devices(&places.usb);
    let finder = Finder { places, libraries, listed, devices: &devices };
    let cameras = devices.iter().filter(|device| device.is_kinect_camera());
    let numbered = cameras.enumerate().map(|(index, camera)| finder.kinect(index, camera));
    let others = devices.iter().filter_map(|device| finder.other(device));
    let mut sensors: Vec<Sensor> =
        numbered.chain(others).chain(finder.without_power()).chain(finder.elsewhere()).collect();
    sensors.sort_by(|a, b| a.port.cmp(&b.port));
    sensors
}

struct Finder<'a> {
    places: &'a Places,
    libraries: &'a [Library],
    /// What OpenNI2 knows of.
    listed: &'a [Listed],
    devices: &'a [Device],
}

impl Finder<'_> {
    fn kinect(&self, index: usize, camera: &Device) -> Sensor {
        let mut abilities = Vec::new();
        let has_motor = self
            .devices
            .iter()
            .any(|device| device.product == MOTOR && device.is_kinect_part() && near(device, camera));
        // Later models drive the motor through their microphones, which takes firmware.
        if has_motor && camera.version == 0x010b {
            abilities.extend([Ability::Tilt, Ability::Led, Ability::Accelerometer]);
        }
        abilities.extend([Ability::ExposureLock, Ability::Stills]);
        let has_serial = camera.serial.chars().any(|digit| digit != '0');
        let serial = if has_serial { camera.serial.clone() } else { String::new() };
        let address =
            if has_serial { format!("freenect:{serial}") } else { format!("freenect:#{}", index + 1) };
        let problems = self.problems(camera, "libfreenect");
        sensor(camera, serial, "freenect", Some(address), abilities, problems)
    }

    fn other(&self, device: &Device) -> Option<Sensor> {
        if device.is_second_kinect() {
            let text = "this is a Kinect of the second generation (Xbox One, Kinect for Windows v2): it needs libfreenect2, \
                        which is not supported; use a Kinect for Xbox 360";
            let problem = blocking(ProblemKind::SecondGeneration, text);
            return Some(sensor(device, device.serial.clone(), "none", None, vec![], vec![problem]));
        }
        if device.vendor == PRIMESENSE {
            let problems = self.problems(device, "OpenNI2");
            let serial = device.serial.clone();
            return Some(sensor(device, serial, "openni2", Some(self.address(device)), vec![], problems));
        }
        None
    }

    /// What opens a sensor of OpenNI2's, and no other one.
    fn address(&self, device: &Device) -> String {
        let on_usb = |device: &Device| {
            format!("{:04x}/{:04x}@{}/{}", device.vendor, device.product, device.bus, device.number)
        };
        let is_alone = self.devices.iter().filter(|other| other.vendor == PRIMESENSE).count() == 1;
        if is_alone && !self.listed.iter().any(|listed| listed.uri == on_usb(device)) {
            return "openni2".to_owned();
        }
        format!("openni2:{}", on_usb(device))
    }

    /// Sensors that OpenNI2 knows of and that were not found on the USB; a Kinect's cameras are libfreenect's.
    fn elsewhere(&self) -> Vec<Sensor> {
        let is_found = |listed: &Listed| {
            self.devices.iter().any(|device| (device.vendor, device.product) == listed.usb)
                || listed.usb.0 == MICROSOFT
        };
        let others = self.listed.iter().filter(|listed| !is_found(listed));
        others
            .map(|listed| Sensor {
                model: plain(&format!("{} {}", listed.vendor, listed.name)),
                serial: String::new(),
                port: String::new(),
                backend: "openni2",
                address: Some(format!("openni2:{}", plain(&listed.uri))),
                abilities: Vec::new(),
                problems: Vec::new(),
            })
            .collect()
    }

    /// Parts of Kinects beside which no camera appears: one sensor for all parts of a Kinect.
    fn without_power(&self) -> Vec<Sensor> {
        let has_camera =
            |part: &Device| self.devices.iter().any(|device| device.is_kinect_camera() && near(device, part));
        let lonely = self.devices.iter().filter(|part| part.is_kinect_part() && !has_camera(part));
        let mut found: Vec<&Device> = Vec::new();
        for part in lonely {
            if !found.iter().any(|other| near(other, part)) {
                found.push(part);
            }
        }
        let text = "only its motor answers, not its camera: its own power supply is missing. A Kinect for Xbox 360 needs the \
                    adapter with a mains plug and a USB plug; check that its lamp shines";
        let unpowered = |part: &Device| Sensor {
            model: "Kinect without power".into(),
            ..sensor(
                part,
                String::new(),
                "freenect",
                None,
                vec![],
                vec![blocking(ProblemKind::NoPower, text)],
            )
        };
        found.into_iter().map(unpowered).collect()
    }

    /// The worst first.
    fn problems(&self, device: &Device, library: &str) -> Vec<Problem> {
        let mut problems = Vec::new();
        if let Some(missing) = self.libraries.iter().find(|known| known.name == library)
            && let Some(advice) = &missing.advice
        {
            problems.push(blocking(ProblemKind::LibraryMissing, &format!("{library} is missing: {advice}")));
        }
        if !(self.places.may_use)(&device.node(&self.places.dev)) {
            problems.push(blocking(ProblemKind::NoPermission, advice::NO_PERMISSION));
        }
        if device.drivers.iter().any(|driver| driver == PROGRAM) {
            problems.push(blocking(ProblemKind::Busy, advice::BUSY));
        }
        if let Some(driver) = device.drivers.iter().find(|driver| *driver != PROGRAM) {
            let text = format!(
                "the system's own driver {driver} holds the camera. It is taken over by itself; if that fails: echo blacklist \
                 {driver} | sudo tee /etc/modprobe.d/kinect.conf, and start the computer anew"
            );
            problems.push(noted(ProblemKind::KernelDriver, &text));
        }
        if let Some(machine) = self.places.virtual_machine() {
            let text = format!(
                "this is a virtual machine ({machine}); most cannot pass the camera's stream on: if no pictures come, use a \
                 real computer"
            );
            problems.push(noted(ProblemKind::VirtualMachine, &text));
        }
        if usb::controller(&self.places.usb, device.bus).as_deref() == Some(USB3) {
            let text = "it hangs on a USB 3 controller, which some Kinects do not like: if pictures are missing or broken, try \
                        another port, best one of USB 2";
            problems.push(noted(ProblemKind::Usb3, text));
        }
        problems
    }
}

/// What a driver says of a sensor goes to a terminal: no control characters.
fn plain(text: &str) -> String {
    text.trim().chars().filter(|c| !c.is_control()).collect()
}

/// Whether two devices are parts of one Kinect: they hang on the hub inside it.
fn near(a: &Device, b: &Device) -> bool {
    let hub = |device: &Device| device.name.rsplit_once('.').map(|(hub, _)| hub.to_owned());
    a.name == b.name || hub(a).is_some() && hub(a) == hub(b)
}

fn sensor(
    device: &Device,
    serial: String,
    backend: &'static str,
    address: Option<String>,
    abilities: Vec<Ability>,
    problems: Vec<Problem>,
) -> Sensor {
    Sensor {
        model: device.model().into(),
        serial,
        port: device.name.clone(),
        backend,
        address,
        abilities,
        problems,
    }
}

fn blocking(kind: ProblemKind, text: &str) -> Problem {
    Problem { kind, blocks: true, text: text.to_owned() }
}

fn noted(kind: ProblemKind, text: &str) -> Problem {
    Problem { kind, blocks: false, text: text.to_owned() }
}
