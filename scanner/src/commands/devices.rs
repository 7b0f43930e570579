//! `scan-product devices`: what is plugged in, and why it cannot be used where it cannot.

use std::fmt::Write;

use kinect::advice::{UDEV_PATH, UDEV_RULES};
use kinect::probe::{self, Library, Look, Sensor};
use kinect::source::Ability;
use serde_json::{Value, json};

use crate::cli::DONE;
use crate::ui::Ui;

const AFTER_HELP: &str = "\
Nothing is opened that another program uses. The simulated Kinect needs no device:
scan-product capture --sensor simulated";

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let look = probe::look();
    ui.result(&in_words(&look), &for_machines(&look)?);
    Ok(DONE)
}

pub(super) fn for_machines(look: &Look) -> anyhow::Result<Value> {
    let mut value = serde_json::to_value(look)?;
    for (index, sensor) in look.sensors.iter().enumerate() {
        value["sensors"][index]["usable"] = sensor.is_usable().into();
    }
    let rules = json!({"path": UDEV_PATH, "text": UDEV_RULES});
    value["udev_rules"] = if look.wants_permission() { rules } else { Value::Null };
    Ok(value)
}

pub(super) fn in_words(look: &Look) -> String {
    let mut words = String::from("Sensors\n");
    for sensor in &look.sensors {
        words += &sensor_in_words(sensor);
    }
    if look.sensors.is_empty() {
        words +=
            "  none is plugged in. A Kinect for Xbox 360 needs its own power supply beside the USB cable;\n";
        words += "  without one, try `scan-product capture --sensor simulated`\n";
    }
    words += "\nLibraries\n";
    for library in &look.libraries {
        words += &library_in_words(library);
    }
    if look.wants_permission() {
        words += &permission_in_words();
    }
    words
}

fn sensor_in_words(sensor: &Sensor) -> String {
    let serial =
        if sensor.serial.is_empty() { String::new() } else { format!(", serial number {}", sensor.serial) };
    let state = if sensor.is_usable() { "ready" } else { "cannot be used" };
    let port = if sensor.port.is_empty() { String::new() } else { format!(", USB port {}", sensor.port) };
    let mut words = format!("  {}{serial}{port}: {state}\n", sensor.model);
    for problem in &sensor.problems {
        let sign = if problem.blocks { "!" } else { "note:" };
        // Writing into memory does not fail.
        let _ = writeln!(words, "    {sign} {}", problem.text);
    }
    if let Some(address) = sensor.address.as_ref().filter(|_| sensor.is_usable()) {
        let _ = writeln!(words, "    scan with it: scan-product capture --sensor {address}");
    }
    if !sensor.abilities.is_empty() && sensor.is_usable() {
        let abilities: Vec<&str> =
            sensor.abilities.iter().map(|ability| ability_in_words(*ability)).collect();
        let _ = writeln!(words, "    besides pictures and depth: {}", abilities.join(", "));
    }
    words
}

fn ability_in_words(ability: Ability) -> &'static str {
    match ability {
        Ability::Tilt => "tilts by motor",
        Ability::Led => "has a lamp",
        Ability::Accelerometer => "feels which way is down",
        Ability::ExposureLock => "holds exposure and white balance",
        Ability::Stills => "takes sharper pictures",
        Ability::Station => "stands where it is told to",
    }
}

fn library_in_words(library: &Library) -> String {
    let Library { name, serves, path, version, advice } = library;
    if let Some(advice) = advice {
        return format!("  {name} ({serves}): missing\n    {advice}\n");
    }
    let version = version.as_deref().unwrap_or("of unknown version");
    let place = path.as_ref().map(|path| format!(", {path}")).unwrap_or_default();
    format!("  {name} ({serves}): {version}{place}\n")
}

fn permission_in_words() -> String {
    format!(
        "\nTo be allowed to use the sensor, put this into {UDEV_PATH}\n(as root), then run `sudo udevadm control --reload`, \
         unplug the sensor and plug it in again:\n\n{UDEV_RULES}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinect::probe::{Problem, ProblemKind};

    fn look() -> Look {
        let library = |name, advice: Option<&str>| Library {
            name,
            serves: "some sensors",
            path: advice.is_none().then(|| "/usr/lib/lib.so.0.5.3".into()),
            version: advice.is_none().then(|| "0.5.3".into()),
            advice: advice.map(str::to_owned),
        };
        let problem = |kind, blocks| Problem { kind, blocks, text: "what is wrong and what to do".into() };
        let sensor = |serial: &str, problems| Sensor {
            model: "Kinect for Xbox 360 (model 1414)".into(),
            serial: serial.into(),
            port: "3-1.3".into(),
            backend: "freenect",
            address: Some(format!("freenect:{serial}")),
            abilities: vec![Ability::Tilt, Ability::Stills],
            problems,
        };
        Look {
            libraries: vec![library("libfreenect", None), library("OpenNI2", Some("install it"))],
            sensors: vec![
                sensor("A0", vec![problem(ProblemKind::Usb3, false)]),
                sensor("B0", vec![problem(ProblemKind::NoPermission, true)]),
            ],
        }
    }

    #[test]
    fn everything_in_words() {
        let words = in_words(&look());
        let expected = "\
Sensors
  Kinect for Xbox 360 (model 1414), serial number A0, USB port 3-1.3: ready
    note: what is wrong and what to do
    scan with it: scan-product capture --sensor freenect:A0
    besides pictures and depth: tilts by motor, takes sharper pictures
  Kinect for Xbox 360 (model 1414), serial number B0, USB port 3-1.3: cannot be used
    ! what is wrong and what to do

Libraries
  libfreenect (some sensors): 0.5.3, /usr/lib/lib.so.0.5.3
  OpenNI2 (some sensors): missing
    install it

To be allowed to use the sensor, put this into /etc/udev/rules.d/60-allround-kinect.rules
";
        assert_eq!(words.split_inclusive("kinect.rules\n").next(), Some(expected));
        assert!(words.ends_with(UDEV_RULES));
    }

    #[test]
    fn nothing_plugged_in() {
        let words = in_words(&Look { sensors: vec![], ..look() });
        assert!(words.contains("none is plugged in") && !words.contains("udev"), "{words}");
    }

    #[test]
    fn for_machines_it_says_what_is_usable() {
        let value = for_machines(&look()).unwrap();
        assert_eq!(
            (&value["sensors"][0]["usable"], &value["sensors"][1]["usable"]),
            (&true.into(), &false.into())
        );
        assert_eq!(value["sensors"][1]["problems"][0]["kind"], "no_permission");
        assert!(value["udev_rules"]["text"].as_str().unwrap().contains("02ae"));
        assert_eq!(value["libraries"][1]["path"], Value::Null);
    }
}
