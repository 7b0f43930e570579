//! Transfers on their way: which wait for packets, which have been cancelled, and what is called back next.

use std::collections::{HashMap, VecDeque};
use std::ffi::{c_int, c_void};
use std::sync::{Mutex, PoisonError};

use crate::kinect::{DEPTH, Kinect, VIDEO};
use crate::settings::SETTINGS;

/// Status: all went well.
const COMPLETED: c_int = 0;
/// Status: cancelled.
const CANCELLED: c_int = 3;
/// Status: no such device any more.
const NO_DEVICE: c_int = 5;

/// libusb's description of a packet.
#[repr(C)]
pub(crate) struct Packet {
    length: u32,
    actual: u32,
    status: c_int,
}

/// libusb's transfer; its packets' descriptions follow behind it.
#[repr(C)]
pub(crate) struct Transfer {
    handle: *mut c_void,
    flags: u8,
    pub(crate) endpoint: u8,
    kind: u8,
    timeout: u32,
    status: c_int,
    length: c_int,
    actual: c_int,
    callback: extern "C" fn(*mut Transfer),
    user: *mut c_void,
    buffer: *mut u8,
    count: c_int,
    packets: [Packet; 0],
}

/// Transfers by address.
#[derive(Default)]
pub(crate) struct Bus {
    pub(crate) kinect: Kinect,
    /// The Kinects were unplugged while this process ran; its handles stay dead.
    pub(crate) dead: bool,
    waiting: HashMap<u8, VecDeque<usize>>,
    cancelled: VecDeque<usize>,
}

static BUS: Mutex<Option<Bus>> = Mutex::new(None);

/// Works on the bus, alone.
pub(crate) fn with<T>(work: impl FnOnce(&mut Bus) -> T) -> T {
    let mut bus = BUS.lock().unwrap_or_else(PoisonError::into_inner);
    let bus = bus.get_or_insert_default();
    bus.dead |= SETTINGS.present.as_ref().is_some_and(|file| !file.exists());
    work(bus)
}

impl Bus {
    pub(crate) fn submit(&mut self, transfer: usize, endpoint: u8) {
        self.waiting.entry(endpoint).or_default().push_back(transfer);
    }

    /// Whether it was waiting.
    pub(crate) fn cancel(&mut self, transfer: usize, endpoint: u8) -> bool {
        let waiting = self.waiting.entry(endpoint).or_default();
        let Some(at) = waiting.iter().position(|&address| address == transfer) else { return false };
        waiting.remove(at);
        self.cancelled.push_back(transfer);
        true
    }

    /// A transfer that is done, with its status and packets.
    fn next_done(&mut self) -> Option<(usize, c_int, Vec<Vec<u8>>)> {
        if let Some(transfer) = self.cancelled.pop_front() {
            return Some((transfer, CANCELLED, vec![]));
        }
        if self.dead {
            let transfer =
                [DEPTH, VIDEO].iter().find_map(|endpoint| self.waiting.get_mut(endpoint)?.pop_front())?;
            return Some((transfer, NO_DEVICE, vec![]));
        }
        for endpoint in [DEPTH, VIDEO] {
            let Some(&transfer) = self.waiting.get(&endpoint).and_then(VecDeque::front) else { continue };
            // SAFETY: it was submitted and has neither been called back nor freed.
            let most = unsafe { (*(transfer as *const Transfer)).count } as usize;
            if let Some(packets) = self.kinect.take(endpoint, most) {
                self.waiting.get_mut(&endpoint)?.pop_front();
                return Some((transfer, COMPLETED, packets));
            }
        }
        None
    }
}

/// Calls back one transfer that is done; `false` where there is none.
pub(crate) fn pump() -> bool {
    let Some((transfer, status, packets)) = with(Bus::next_done) else { return false };
    let transfer = transfer as *mut Transfer;
    // SAFETY: the library made it with room for `count` packets in description and buffer, and waits for it.
    unsafe {
        let descriptions = (&raw mut (*transfer).packets).cast::<Packet>();
        for index in 0..(*transfer).count as usize {
            let description = &mut *descriptions.add(index);
            let bytes = packets.get(index).map_or(&[][..], Vec::as_slice);
            let place = (*transfer).buffer.add(index * description.length as usize);
            std::ptr::copy_nonoverlapping(
                bytes.as_ptr(),
                place,
                bytes.len().min(description.length as usize),
            );
            description.actual = bytes.len() as u32;
            description.status = COMPLETED;
        }
        (*transfer).status = status;
        // Outside the lock: the library submits it again from within.
        ((*transfer).callback)(transfer);
    }
    true
}
