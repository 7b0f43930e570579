//! A USB bus with Kinects of model 1414 on it, in the place of `libusb-1.0`: what libfreenect imports of libusb is here.
//!
//! Preloaded (`LD_PRELOAD`) under the real libfreenect it answers the device's protocol (`kinect`) and sends its streams
//! as packets (`packets`), so that everything above the bus is the real thing: formats, registration, lost packets,
//! unplugging, registers at the end. Environment variables say how the bus behaves (`settings`).

mod bus;
mod kinect;
mod packets;
mod settings;
mod symbols;
