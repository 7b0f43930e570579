//! Finds and opens the sensor that is asked for, as much of it as there is.

use std::rc::Rc;

use super::depth::Mapping;
use super::handle::{Context, Parts, Sensor, Which};
use super::inbox;
use super::mode::Format;
use super::rig;
use reconstruct::recording::Rig;

use crate::advice;
use crate::source::{Ability, SensorInfo};
use crate::usb;
use crate::wire::Failure;
use crate::worker::DriverError;

/// An open sensor and what it is.
pub(super) struct Opened {
    pub(super) sensor: Sensor,
    pub(super) info: SensorInfo,
    pub(super) mapping: Mapping,
}

/// Opens the sensor that `target` names: nothing for the first, `#2` for the second, or a serial number.
pub(super) fn open(context: &Rc<Context>, target: &str) -> Result<Opened, DriverError> {
    let serials = context.serials();
    let (which, serial) = choose(context.count(), &serials, target)?;
    let _ = inbox::take_lines();
    // Asking for a motor that is driven otherwise, or is not there, makes the whole opening fail.
    for parts in [Parts::CamerasAndMotor, Parts::Cameras] {
        if let Some(sensor) = context.open(&which, parts)? {
            let constants = sensor.constants().unwrap_or_default();
            let info = describe(context, &sensor, parts, &which, serial, rig(&constants));
            return Ok(Opened { sensor, info, mapping: Mapping::new(&constants) });
        }
    }
    Err(DriverError::Failed(refusal(&inbox::take_lines())))
}

fn choose(count: usize, serials: &[String], target: &str) -> Result<(Which, String), DriverError> {
    let missing = |words: String| Err(DriverError::Failed(Failure::NotFound(words)));
    if count == 0 {
        return missing("no Kinect is plugged in (`scan-product devices` says what is)".into());
    }
    let number =
        if target.is_empty() { Some(1) } else { target.strip_prefix('#').and_then(|n| n.parse().ok()) };
    match number {
        Some(number) if (1..=count).contains(&number) => {
            // Only where every sensor has told its serial number is the order of both lists the same.
            let serial = if serials.len() == count { serials[number - 1].clone() } else { String::new() };
            Ok((Which::Number(number - 1), serial))
        }
        Some(number) => missing(format!("there is no Kinect number {number}: {count} are plugged in")),
        None if serials.iter().any(|serial| serial == target) => {
            Ok((Which::Serial(target.to_owned()), target.to_owned()))
        }
        None => {
            let known =
                if serials.is_empty() { "none that tells its own".to_owned() } else { serials.join(", ") };
            missing(format!("no Kinect with serial number {target} is plugged in, but {known}"))
        }
    }
}

fn describe(
    context: &Context,
    sensor: &Sensor,
    parts: Parts,
    which: &Which,
    serial: String,
    rig: Rig,
) -> SensorInfo {
    let mut abilities = Vec::new();
    if parts == Parts::CamerasAndMotor && !context.is_replay() {
        abilities.extend([Ability::Tilt, Ability::Led]);
    }
    if parts == Parts::CamerasAndMotor {
        abilities.push(Ability::Accelerometer);
    }
    if sensor.can_lock_exposure() {
        abilities.push(Ability::ExposureLock);
    }
    if sensor.offers(Format::LargeColor) {
        abilities.push(Ability::Stills);
    }
    // Some models all bear the same number: their place in the list must do.
    let unique = serial.chars().any(|digit| digit != '0');
    let address = match which {
        _ if unique => format!("freenect:{serial}"),
        Which::Number(number) => format!("freenect:#{}", number + 1),
        Which::Serial(serial) => format!("freenect:{serial}"),
    };
    let model = if context.is_replay() { "a recorded Kinect".to_owned() } else { usb::kinect_model(&serial) };
    SensorInfo { backend: "freenect".into(), address, model, serial, rig, units_per_metre: 1000.0, abilities }
}

/// Why the library refused, from what it logged: libusb's name for it, or (older ones) its number at a line's end.
fn refusal(lines: &[String]) -> Failure {
    let says =
        |name: &str, number: &str| lines.iter().any(|line| line.contains(name) || line.ends_with(number));
    if says("LIBUSB_ERROR_ACCESS", ": -3") {
        return Failure::Refused(advice::NO_PERMISSION.into());
    }
    if says("LIBUSB_ERROR_BUSY", ": -6") {
        return Failure::Refused(advice::BUSY.into());
    }
    // The first is the cause, the others its consequences.
    let said = lines.first().map(|line| format!(" ({line})")).unwrap_or_default();
    Failure::Refused(format!("{}{said}", advice::NO_ANSWER))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(count: usize, serials: &[&str], target: &str) -> Result<(Which, String), String> {
        let serials: Vec<String> = serials.iter().map(|s| (*s).to_owned()).collect();
        choose(count, &serials, target).map_err(|error| format!("{error:?}"))
    }

    #[test]
    fn by_nothing_by_number_and_by_serial() {
        assert_eq!(chosen(2, &["A", "B"], ""), Ok((Which::Number(0), "A".into())));
        assert_eq!(chosen(2, &["A", "B"], "#2"), Ok((Which::Number(1), "B".into())));
        assert_eq!(chosen(2, &["B"], "#2"), Ok((Which::Number(1), String::new())));
        assert_eq!(chosen(2, &["A", "B"], "B"), Ok((Which::Serial("B".into()), "B".into())));
        assert!(chosen(0, &[], "").unwrap_err().contains("no Kinect is plugged in"));
        assert!(chosen(1, &["A"], "C").unwrap_err().contains("but A"));
        assert!(chosen(1, &["A"], "#2").unwrap_err().contains("number 2"));
        assert!(chosen(1, &["A"], "#0").is_err());
    }

    #[test]
    fn refusals_in_words() {
        let said = |line: &str| refusal(&[line.to_owned()]);
        assert_eq!(said("Could not open camera: -3"), Failure::Refused(advice::NO_PERMISSION.into()));
        assert_eq!(
            said("Could not claim interface: LIBUSB_ERROR_BUSY"),
            Failure::Refused(advice::BUSY.into())
        );
        assert!(matches!(said("whatever"), Failure::Refused(words) if words.contains("(whatever)")));
    }
}
