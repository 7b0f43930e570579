//! What is known of one sensor's depth errors, kept by its serial number and used in every later build of its recordings.
//!
//! The file lies in the user's data folder (`SCAN_CALIBRATION_DIR`, else `$XDG_DATA_HOME/allround/calibration`, else
//! `~/.local/share/allround/calibration`), one a sensor. Coefficients are those of [`reconstruct::calibrate`]: disparity,
//! pixels, in the colour camera's geometry.

use std::path::{Path, PathBuf};

use reconstruct::average::BASELINE_METRES;
use reconstruct::calibrate::{CalibrationPrior, DepthCalibration, TERMS};
use reconstruct::recording::{Device, Rig};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::output::{self, OutputError};
use crate::recording::Recording;

/// The variable that may name the folder.
const FOLDER_VARIABLE: &str = "SCAN_CALIBRATION_DIR";
/// Largest file that is read.
const MAX_BYTES: u64 = 1 << 20;
/// No Kinect errs by more than this: scale, and pixels for all else.
const MAX_COEFFICIENT: f64 = 2.0;
/// Cameras whose numbers differ by less than this are the same, pixels.
const SAME_CAMERA_PX: f64 = 0.5;

/// A sensor's calibration as it is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UnitCalibration {
    /// Always 1.
    pub version: u32,
    /// The sensor.
    pub device: Device,
    /// Size of the pictures it was made with.
    pub width: u32,
    /// See `width`.
    pub height: u32,
    /// Focal length of the colour camera, pixels; with the baseline it turns disparity into depth.
    pub fx: f64,
    /// The correction.
    pub coefficients: [f64; TERMS],
    /// How far it may be off.
    pub standard_deviations: [f64; TERMS],
    /// Board pixels it was made from.
    pub samples: usize,
    /// What is left on the board, pixels of disparity.
    pub residual_px: f64,
    /// Median error on the board before and after, millimetres.
    pub error_mm: [f64; 2],
    /// Nearest and farthest board pixel, metres.
    pub distances_m: [f64; 2],
}

/// Why a calibration cannot be kept or used.
#[derive(Debug, Error)]
pub enum UnitCalibrationError {
    /// Recordings of an unnamed sensor belong to nobody.
    #[error(
        "this recording does not say which sensor took it (device.serial is empty), so a calibration cannot be kept for it"
    )]
    NoSerial,
    /// There is no home.
    #[error("no folder for calibrations: set HOME, XDG_DATA_HOME or {FOLDER_VARIABLE}")]
    NoFolder,
    /// The file cannot be used.
    #[error("the calibration {} cannot be used ({what}): make it anew with `scan-product calibrate`, or remove it", path.display())]
    Unusable {
        /// The file.
        path: PathBuf,
        /// Why.
        what: String,
    },
    /// It cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

impl UnitCalibration {
    /// A calibration of a sensor's pictures.
    pub fn new(device: &Device, rig: &Rig, found: &DepthCalibration, distances_m: [f64; 2]) -> Self {
        Self {
            version: 1,
            device: device.clone(),
            width: rig.color.width,
            height: rig.color.height,
            fx: rig.color.fx,
            coefficients: found.coefficients,
            standard_deviations: found.standard_deviations,
            samples: found.samples,
            residual_px: found.residual_px,
            error_mm: found.error_metres.map(|metres| metres * 1000.0),
            distances_m,
        }
    }

    /// What a build believes before it sees the board.
    pub fn prior(&self) -> CalibrationPrior {
        CalibrationPrior::of_this_sensor(self.coefficients, self.standard_deviations)
    }

    /// Whether it is of this very sensor, and was made with pictures of this geometry.
    pub fn fits(&self, device: &Device, rig: &Rig) -> bool {
        let same_size = (self.width, self.height) == (rig.color.width, rig.color.height);
        // Two serial numbers may look alike as names of files.
        self.device == *device && same_size && (self.fx - rig.color.fx).abs() < SAME_CAMERA_PX
    }

    /// Metres at a disparity.
    pub fn metres(fx: f64, disparity_px: f64) -> f64 {
        fx * BASELINE_METRES / disparity_px
    }

    fn check(&self) -> Result<(), &'static str> {
        let sane = |v: &f64| v.is_finite() && v.abs() <= MAX_COEFFICIENT;
        if self.version != 1 {
            Err("it was written by a newer program")
        } else if !self.coefficients.iter().all(sane)
            || !self.standard_deviations.iter().all(|v| sane(v) && *v > 0.0)
        {
            Err("its numbers are no sensor's")
        } else {
            Ok(())
        }
    }
}

/// The calibration kept for a sensor; none where there is none, or none that fits its pictures.
pub fn of_sensor(device: &Device, rig: &Rig) -> Result<Option<UnitCalibration>, UnitCalibrationError> {
    let (Some(folder), Ok(name)) = (folder(), file_name(device)) else { return Ok(None) };
    Ok(load(&folder.join(name))?.filter(|calibration| calibration.fits(device, rig)))
}

/// What a build of a recording believes of its sensor's depth; none where the sensor was never calibrated.
pub fn prior_of(recording: &Recording) -> Result<Option<CalibrationPrior>, UnitCalibrationError> {
    let kept = of_sensor(&recording.file().device, &recording.rig())?;
    Ok(kept.map(|calibration| calibration.prior()))
}

/// Keeps it for its sensor; returns where. An older one is replaced.
pub fn keep(calibration: &UnitCalibration) -> Result<PathBuf, UnitCalibrationError> {
    let name = file_name(&calibration.device)?;
    let folder = folder().ok_or(UnitCalibrationError::NoFolder)?;
    let path = folder.join(name);
    let io = |source| OutputError::Io { path: folder.clone(), source };
    std::fs::create_dir_all(&folder).map_err(io)?;
    let bytes = serde_json::to_vec_pretty(calibration).map_err(|e| io(std::io::Error::other(e)))?;
    output::write_file(&path, &bytes)?;
    Ok(path)
}

fn load(path: &Path) -> Result<Option<UnitCalibration>, UnitCalibrationError> {
    let unusable = |what: String| UnitCalibrationError::Unusable { path: path.to_owned(), what };
    match std::fs::metadata(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(unusable(e.to_string())),
        Ok(meta) if meta.len() > MAX_BYTES => return Err(unusable("it is too long".to_owned())),
        Ok(_) => {}
    }
    let bytes = std::fs::read(path).map_err(|e| unusable(e.to_string()))?;
    let calibration: UnitCalibration = serde_json::from_slice(&bytes).map_err(|e| unusable(e.to_string()))?;
    calibration.check().map_err(|what| unusable(what.to_owned()))?;
    Ok(Some(calibration))
}

fn folder() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let data = || set("XDG_DATA_HOME").or_else(|| Some(set("HOME")?.join(".local/share")));
    set(FOLDER_VARIABLE).or_else(|| Some(data()?.join("allround/calibration")))
}

/// A name without a way out of the folder, whatever the serial number holds.
fn file_name(device: &Device) -> Result<String, UnitCalibrationError> {
    let plain = |text: &str| -> String {
        text.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).take(64).collect()
    };
    // Some models all say that they are number zero.
    if device.serial.chars().all(|c| c == '0') {
        return Err(UnitCalibrationError::NoSerial);
    }
    Ok(format!("{}-{}.json", plain(&device.backend), plain(&device.serial)))
}

#[cfg(test)]
mod tests {
    use reconstruct::camera::Intrinsics;
    use reconstruct::pose::Pose;

    use super::*;

    fn device(serial: &str) -> Device {
        Device { backend: "freenect".into(), serial: serial.into() }
    }

    #[test]
    fn names_stay_in_the_folder() {
        assert_eq!(file_name(&device("A00363")).unwrap(), "freenect-A00363.json");
        assert_eq!(file_name(&device("../../x y")).unwrap(), "freenect-______x_y.json");
        for unnamed in ["", "0000000000000000"] {
            assert!(matches!(file_name(&device(unnamed)), Err(UnitCalibrationError::NoSerial)));
        }
    }

    #[test]
    fn what_is_kept_is_read_again_and_nonsense_is_refused() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("c.json");
        assert!(load(&path).unwrap().is_none());
        let mut kept = UnitCalibration {
            version: 1,
            device: device("A1"),
            width: 640,
            height: 480,
            fx: 525.0,
            coefficients: [0.01; TERMS],
            standard_deviations: [0.001; TERMS],
            samples: 9000,
            residual_px: 0.1,
            error_mm: [10.0, 0.1],
            distances_m: [0.5, 1.1],
        };
        let write =
            |kept: &UnitCalibration| std::fs::write(&path, serde_json::to_vec(kept).unwrap()).unwrap();
        write(&kept);
        assert_eq!(load(&path).unwrap().unwrap(), kept);
        let camera = Intrinsics::pinhole(640, 480, 525.0, 525.0, 319.5, 239.5);
        let rig = Rig { color: camera, depth: camera, color_from_depth: Pose::identity() };
        let other = Rig { color: Intrinsics { fx: 580.0, ..camera }, ..rig };
        assert!(kept.fits(&device("A1"), &rig));
        assert!(!kept.fits(&device("A_1"), &rig) && !kept.fits(&device("A1"), &other));
        kept.coefficients[0] = 7.0;
        write(&kept);
        assert!(load(&path).unwrap_err().to_string().contains("make it anew"));
        std::fs::write(&path, "{").unwrap();
        assert!(load(&path).is_err());
    }
}
