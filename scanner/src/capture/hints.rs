//! What the seller should do now, in words: a traffic light from what a picture shows. Pure; metres, seconds.

use serde::Serialize;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// A view can be taken.
    Green,
    /// A view can be taken, but could be better.
    Yellow,
    /// No good view can be taken.
    Red,
}

/// What a hint is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Code {
    TooNear,
    TooFar,
    TooDark,
    TooBright,
    Moving,
    BoardHidden,
    BoardUnknown,
    NoDepth,
    Sunlight,
    LostPackets,
    ProductOutside,
    Ok,
}

/// One sentence for the seller.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Hint {
    pub level: Level,
    pub code: Code,
    pub text: String,
}

/// What is known of the board in a picture.
#[derive(Debug, Clone, PartialEq)]
pub enum Board {
    /// No board was chosen yet.
    NotChosen,
    /// So few of its tags can be read.
    Hidden(usize),
    /// Tags are seen, but not this board's; what is wrong, in words.
    Unknown(String),
    /// The camera's place on it is known, by so many tags of so many.
    Placed(usize, usize),
}

/// What one picture shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    pub board: Board,
    /// From the camera to the product, or to the board's middle.
    pub distance: Option<f64>,
    /// Mean grey level, 0 to 255.
    pub brightness: f64,
    /// Share of pixels that are burnt out.
    pub burnt: f64,
    /// Share of all pixels that have depth.
    pub valid_depth: f64,
    /// Share of the pixels where the product stands that have depth; none where the board is not placed.
    pub valid_on_product: Option<f64>,
    /// Pixels of the product and of what stands beside it, as shares of the picture; none where the board is not placed.
    pub product: Option<[f64; 2]>,
    /// Packets lost during the last second.
    pub lost_packets: u32,
    /// How long nothing has moved.
    pub still_seconds: f64,
}

/// Distances at which a Kinect measures at all, and at which it measures well, metres.
const REACH: std::ops::RangeInclusive<f64> = 0.45..=1.6;
const GOOD_REACH: std::ops::RangeInclusive<f64> = 0.5..=1.2;
/// Grey levels below which markers drown in noise, and below which colours do.
const DARK: f64 = 22.0;
const DIM: f64 = 48.0;
/// Share of burnt-out pixels that is too much: white paper alone may be some.
const BURNT: f64 = 0.35;
/// Less depth than this in the whole picture means that the infrared pattern drowns or never arrives.
const HARDLY_ANY_DEPTH: f64 = 0.25;
/// Bright surroundings, grey level.
const BRIGHT: f64 = 140.0;
/// Where the product stands, less depth than this leaves holes, and less than that shows nothing.
const HOLES: f64 = 0.6;
const NOTHING: f64 = 0.25;
/// Share of the picture from which something counts as a product.
const SEEN: f64 = 0.0015;
/// Shorter stillness blurs the picture and smears the depth.
const STILL_SECONDS: f64 = 0.3;
/// A good pose needs this many tags.
const GOOD_TAGS: usize = 4;

/// All hints of a picture, worst first; a single `ok` where there is nothing to say.
pub fn hints(sight: &Sight) -> Vec<Hint> {
    let found = [board(sight), light(sight), depth(sight), distance(sight), product(sight), motion(sight)];
    let mut hints: Vec<Hint> = found.into_iter().flatten().chain(packets(sight)).collect();
    if hints.is_empty() {
        let text = "Good: a view can be taken.".to_owned();
        hints.push(Hint { level: Level::Green, code: Code::Ok, text });
    }
    hints.sort_by_key(|hint| std::cmp::Reverse(hint.level));
    hints
}

/// The worst of the hints.
pub fn light_of(hints: &[Hint]) -> Level {
    hints.iter().map(|hint| hint.level).max().unwrap_or(Level::Red)
}

fn hint(level: Level, code: Code, text: impl Into<String>) -> Hint {
    Hint { level, code, text: text.into() }
}

fn board(sight: &Sight) -> Option<Hint> {
    let (level, code, text) = match &sight.board {
        Board::NotChosen | Board::Placed(GOOD_TAGS.., _) => return None,
        Board::Hidden(0) => {
            let text = "No marker of the board can be seen: turn the sensor to the board.".to_owned();
            (Level::Red, Code::BoardHidden, text)
        }
        Board::Hidden(tags) => {
            let text = format!("Only {tags} of the markers can be read: show more of the board.");
            (Level::Red, Code::BoardHidden, text)
        }
        Board::Unknown(what) => (Level::Red, Code::BoardUnknown, format!("This is another board: {what}.")),
        Board::Placed(tags, of) => {
            let text = format!(
                "Only {tags} of {of} markers can be read: with four or more the view will be more exact."
            );
            (Level::Yellow, Code::BoardHidden, text)
        }
    };
    Some(hint(level, code, text))
}

fn light(sight: &Sight) -> Option<Hint> {
    let (level, code, text) = if sight.brightness < DARK {
        let text = "It is too dark: the markers and colours cannot be seen. Switch on a lamp.";
        (Level::Red, Code::TooDark, text)
    } else if sight.burnt > BURNT {
        let text = "The picture is burnt out: take away the direct light, or close the curtains.";
        (Level::Yellow, Code::TooBright, text)
    } else if sight.brightness < DIM {
        (Level::Yellow, Code::TooDark, "It is rather dark: with more light the colours become better.")
    } else {
        return None;
    };
    Some(hint(level, code, text))
}

fn depth(sight: &Sight) -> Option<Hint> {
    if sight.valid_depth < HARDLY_ANY_DEPTH {
        let (code, text) = if sight.brightness > BRIGHT {
            let text = "Hardly any depth is measured and it is very bright: sunlight drowns the sensor's own light. \
                        Close the curtains or move away from the window.";
            (Code::Sunlight, text)
        } else {
            let text =
                "Hardly any depth is measured: keep 0.5 to 1.2 m distance and let nothing cover the sensor.";
            (Code::NoDepth, text)
        };
        return Some(hint(Level::Red, code, text));
    }
    let share = sight.valid_on_product?;
    let percent = (share * 100.0).round();
    if share < NOTHING {
        let text = format!(
            "Where the product stands, only {percent} % has depth: dark, shiny or transparent surfaces give none. \
             Dust it with powder or hair spray, or turn it."
        );
        return Some(hint(Level::Red, Code::NoDepth, text));
    }
    let text =
        format!("Where the product stands, {percent} % has depth: dark or shiny places will be missing.");
    (share < HOLES).then(|| hint(Level::Yellow, Code::NoDepth, text))
}

fn distance(sight: &Sight) -> Option<Hint> {
    let metres = sight.distance?;
    let level = if REACH.contains(&metres) { Level::Yellow } else { Level::Red };
    let (code, verb) = if metres < *GOOD_REACH.start() {
        (Code::TooNear, "back")
    } else if metres > *GOOD_REACH.end() {
        (Code::TooFar, "nearer")
    } else {
        return None;
    };
    let text = format!("Move the sensor {verb}: the product is at {metres:.2} m, 0.5 to 1.2 m is good.");
    Some(hint(level, code, text))
}

fn product(sight: &Sight) -> Option<Hint> {
    let [product, outside] = sight.product?;
    let text = if outside > product && outside > SEEN {
        "Something stands beside the middle of the board: put the product inside the outline and take all else away."
    } else if product < SEEN {
        "Nothing stands in the middle of the board: put the product inside the outline."
    } else {
        return None;
    };
    Some(hint(Level::Red, Code::ProductOutside, text))
}

fn motion(sight: &Sight) -> Option<Hint> {
    let text = "Something moves: let the sensor and the product stand still.";
    (sight.still_seconds < STILL_SECONDS).then(|| hint(Level::Yellow, Code::Moving, text))
}

fn packets(sight: &Sight) -> Option<Hint> {
    let lost = sight.lost_packets;
    let text = format!(
        "{lost} packets of the sensor were lost: plug it into a port of its own, without a hub, and close other programs."
    );
    (lost > 0).then(|| hint(Level::Yellow, Code::LostPackets, text))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Sight {
        Sight {
            board: Board::Placed(14, 20),
            distance: Some(0.8),
            brightness: 120.0,
            burnt: 0.02,
            valid_depth: 0.8,
            valid_on_product: Some(0.95),
            product: Some([0.05, 0.0]),
            lost_packets: 0,
            still_seconds: 2.0,
        }
    }

    #[track_caller]
    fn check(sight: &Sight, level: Level, code: Code, words: &str) {
        let hints = hints(sight);
        assert_eq!((hints[0].level, hints[0].code), (level, code), "{hints:?}");
        assert_eq!(light_of(&hints), level);
        assert!(hints[0].text.contains(words), "{hints:?}");
    }

    #[test]
    fn nothing_to_say_is_green() {
        check(&good(), Level::Green, Code::Ok, "can be taken");
        assert_eq!(hints(&good()).len(), 1);
        let unplaced = Sight { board: Board::NotChosen, distance: None, product: None, ..good() };
        check(&Sight { valid_on_product: None, ..unplaced }, Level::Green, Code::Ok, "");
    }

    #[test]
    fn distances() {
        let at = |distance| Sight { distance: Some(distance), ..good() };
        check(&at(0.42), Level::Red, Code::TooNear, "back: the product is at 0.42 m");
        check(&at(0.47), Level::Yellow, Code::TooNear, "back");
        check(&at(1.4), Level::Yellow, Code::TooFar, "nearer");
        check(&at(2.0), Level::Red, Code::TooFar, "nearer");
    }

    #[test]
    fn light() {
        check(&Sight { brightness: 10.0, ..good() }, Level::Red, Code::TooDark, "lamp");
        check(&Sight { brightness: 40.0, ..good() }, Level::Yellow, Code::TooDark, "rather dark");
        check(&Sight { burnt: 0.5, ..good() }, Level::Yellow, Code::TooBright, "burnt out");
    }

    #[test]
    fn the_board() {
        let with = |board| Sight { board, distance: None, product: None, valid_on_product: None, ..good() };
        check(&with(Board::Hidden(0)), Level::Red, Code::BoardHidden, "No marker");
        check(&with(Board::Hidden(1)), Level::Red, Code::BoardHidden, "Only 1");
        check(&with(Board::Unknown("tag 7 is not on it".into())), Level::Red, Code::BoardUnknown, "tag 7");
        check(&with(Board::Placed(3, 20)), Level::Yellow, Code::BoardHidden, "3 of 20");
        check(&with(Board::Placed(4, 20)), Level::Green, Code::Ok, "");
    }

    #[test]
    fn depth_that_is_missing() {
        check(&Sight { valid_depth: 0.1, ..good() }, Level::Red, Code::NoDepth, "Hardly any");
        check(
            &Sight { valid_depth: 0.1, brightness: 200.0, ..good() },
            Level::Red,
            Code::Sunlight,
            "curtains",
        );
        check(&Sight { valid_on_product: Some(0.1), ..good() }, Level::Red, Code::NoDepth, "10 %");
        check(&Sight { valid_on_product: Some(0.5), ..good() }, Level::Yellow, Code::NoDepth, "50 %");
    }

    #[test]
    fn the_product() {
        check(
            &Sight { product: Some([0.0, 0.0]), ..good() },
            Level::Red,
            Code::ProductOutside,
            "Nothing stands",
        );
        check(&Sight { product: Some([0.01, 0.05]), ..good() }, Level::Red, Code::ProductOutside, "beside");
        check(&Sight { product: Some([0.05, 0.01]), ..good() }, Level::Green, Code::Ok, "");
    }

    #[test]
    fn motion_and_packets_and_the_worst_comes_first() {
        check(&Sight { still_seconds: 0.0, ..good() }, Level::Yellow, Code::Moving, "still");
        check(&Sight { lost_packets: 3, ..good() }, Level::Yellow, Code::LostPackets, "3 packets");
        let much = Sight { still_seconds: 0.0, lost_packets: 3, distance: Some(0.3), ..good() };
        check(&much, Level::Red, Code::TooNear, "0.30 m");
        assert_eq!(hints(&much).len(), 3);
    }
}
