//! ASC: text, a point a line, `X Y Z R G B` in **millimetres** with 3 decimals, colours 0 to 255.
//!
//! The writer is exact. The reader takes what other programs write: blanks, tabs, commas or semicolons between values,
//! comments, a heading, a leading count, further columns, no colours.

use std::io::{BufRead, Write};

use super::lines::{Lines, shown};
use super::{Limits, ModelError, checked_point, decimal};
use crate::cloud::PointCloud;

/// Colour of points that have none where others do, and of a cloud without colours when written.
const GRAY: [u8; 3] = [200; 3];

/// Reads points, metres; colours where at least one line has them.
pub fn read(reader: impl BufRead, limits: &Limits) -> Result<PointCloud, ModelError> {
    let mut lines = Lines::new(reader, limits.max_line_bytes);
    let mut cloud = PointCloud::default();
    let mut colored = false;
    while let Some((line, text)) = lines.next()? {
        if let Some((millimetres, color)) = plain_point(text) {
            push(&mut cloud, millimetres, color, limits)?;
            colored |= color.is_some();
            continue;
        }
        let fields = match fields_of(text) {
            Some(fields) if fields.count > 0 => fields,
            _ => continue,
        };
        if cloud.is_empty() && fields.count == 1 {
            check_count(fields.values[0], limits)?;
            continue;
        }
        if cloud.is_empty() && is_heading(&fields) {
            continue;
        }
        ModelError::refuse_more("points", cloud.len() as u64 + 1, limits.max_points)?;
        let millimetres = coordinates(&fields, line)?;
        let color = color(&fields, line)?;
        push(&mut cloud, millimetres, color, limits)?;
        colored |= color.is_some();
    }
    if cloud.is_empty() {
        return Err(ModelError::Empty);
    }
    if !colored {
        cloud.colors = Vec::new();
    }
    Ok(cloud)
}

/// Three or six plain numbers and nothing else but blanks, as most lines are; anything else is looked at with more care.
fn plain_point(line: &[u8]) -> Option<([f64; 3], Option<[u8; 3]>)> {
    let mut rest = line;
    let point = [plain_value(&mut rest)?, plain_value(&mut rest)?, plain_value(&mut rest)?];
    if rest.is_empty() {
        return Some((point, None));
    }
    let mut channel =
        || plain_value(&mut rest).filter(|v| (0.0..=255.0).contains(v)).map(|v| v.round() as u8);
    let color = [channel()?, channel()?, channel()?];
    rest.is_empty().then_some((point, Some(color)))
}

/// The number at the beginning, which it takes away with the blanks after it.
#[inline]
fn plain_value(rest: &mut &[u8]) -> Option<f64> {
    let (value, length) = decimal::leading(rest)?;
    let blanks = rest[length..].iter().take_while(|b| matches!(b, b' ' | b'\t')).count();
    *rest = &rest[length + blanks..];
    Some(value)
}

fn push(
    cloud: &mut PointCloud,
    millimetres: [f64; 3],
    color: Option<[u8; 3]>,
    limits: &Limits,
) -> Result<(), ModelError> {
    let number = cloud.len() + 1;
    ModelError::refuse_more("points", number as u64, limits.max_points)?;
    cloud.points.push(checked_point(millimetres.map(|v| (v / 1000.0) as f32), number)?);
    cloud.colors.push(color.unwrap_or(GRAY));
    Ok(())
}

/// Writes points given in metres; points without colour are light grey.
pub fn write(cloud: &PointCloud, mut writer: impl Write) -> std::io::Result<()> {
    let has_colors = cloud.has_colors();
    for (i, point) in cloud.points.iter().enumerate() {
        for &metres in point {
            write_millimetres(&mut writer, metres)?;
        }
        let [r, g, b] = if has_colors { cloud.colors[i] } else { GRAY };
        writeln!(writer, "{r} {g} {b}")?;
    }
    Ok(())
}

/// Whether the first line that is no comment holds numbers.
pub(super) fn looks_like(start: &[u8]) -> bool {
    let lines = start.split(|&b| b == b'\n').filter_map(|line| fields_of(line.trim_ascii()));
    lines
        .filter(|fields| fields.count > 0)
        .take(2)
        .any(|fields| fields.count >= 3 && fields.values[..3].iter().all(|value| number(value).is_some()))
}

/// Up to six values of a line; further columns are counted alone.
struct Fields<'a> {
    values: [&'a [u8]; 6],
    count: usize,
}

/// `None` for a comment.
fn fields_of(line: &[u8]) -> Option<Fields<'_>> {
    if matches!(line.first(), Some(b'#' | b'%' | b'!')) || line.starts_with(b"//") {
        return None;
    }
    let mut fields = Fields { values: [b""; 6], count: 0 };
    let separator = |b: &u8| b.is_ascii_whitespace() || *b == b',' || *b == b';';
    for value in line.split(separator).filter(|value| !value.is_empty()) {
        if fields.count < 6 {
            fields.values[fields.count] = value;
        }
        fields.count += 1;
    }
    Some(fields)
}

/// Some programs begin with the number of points.
fn check_count(value: &[u8], limits: &Limits) -> Result<(), ModelError> {
    match number(value) {
        Some(count) if count >= 0.0 => ModelError::refuse_more("points", count as u64, limits.max_points),
        _ => Ok(()),
    }
}

/// Names of columns: letters where numbers are expected.
fn is_heading(fields: &Fields<'_>) -> bool {
    let used = &fields.values[..fields.count.min(6)];
    used.iter().all(|value| value.iter().any(u8::is_ascii_alphabetic) && number(value).is_none())
}

fn number(value: &[u8]) -> Option<f64> {
    std::str::from_utf8(value).ok()?.parse().ok()
}

fn coordinates(fields: &Fields<'_>, line: usize) -> Result<[f64; 3], ModelError> {
    if fields.count < 3 {
        return Err(ModelError::Line { line, what: format!("{} values are no point", fields.count) });
    }
    let mut out = [0.0; 3];
    for (out, value) in out.iter_mut().zip(fields.values) {
        let not_a_number = || ModelError::Line { line, what: format!("{} is not a number", shown(value)) };
        *out = number(value).filter(|v| v.is_finite()).ok_or_else(not_a_number)?;
    }
    Ok(out)
}

/// Columns 4 to 6 where there are as many.
fn color(fields: &Fields<'_>, line: usize) -> Result<Option<[u8; 3]>, ModelError> {
    if fields.count < 6 {
        return Ok(None);
    }
    let mut out = [0; 3];
    for (out, value) in out.iter_mut().zip(&fields.values[3..]) {
        let not_a_color = || ModelError::Line {
            line,
            what: format!("{} is not a colour value from 0 to 255", shown(value)),
        };
        *out = number(value).filter(|v| (0.0..=255.0).contains(v)).ok_or_else(not_a_color)?.round() as u8;
    }
    Ok(Some(out))
}

/// Three decimals and a blank, by whole micrometres: no `-0.000`, the same on every machine.
fn write_millimetres(writer: &mut impl Write, metres: f32) -> std::io::Result<()> {
    let micrometres = (f64::from(metres) * 1e6).round() as i64;
    let sign = if micrometres < 0 { "-" } else { "" };
    let (whole, rest) = (micrometres.unsigned_abs() / 1000, micrometres.unsigned_abs() % 1000);
    write!(writer, "{sign}{whole}.{rest:03} ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<PointCloud, ModelError> {
        read(text.as_bytes(), &Limits::default())
    }

    #[test]
    fn the_writer_is_exact() {
        let cloud = PointCloud {
            points: vec![[0.001, -0.002_000_4, 1.5], [-0.000_000_1, 0.0, 0.0]],
            colors: vec![[1, 2, 3], [255, 0, 9]],
            normals: vec![],
        };
        let mut text = Vec::new();
        write(&cloud, &mut text).unwrap();
        assert_eq!(
            String::from_utf8(text).unwrap(),
            "1.000 -2.000 1500.000 1 2 3\n0.000 0.000 0.000 255 0 9\n"
        );
    }

    #[test]
    fn the_reader_takes_what_others_write() {
        for text in [
            "1 2 3 10 20 30\n",
            "# made by hand\r\n1\t2\t3\t10\t20\t30\r\n",
            "x,y,z,r,g,b\n1.0,2.0,3.0,10,20,30",
            "1\n1e0; 2; +3; 10; 20; 30; 0.5; 0.5\n\n",
        ] {
            let cloud = read_text(text).unwrap();
            assert_eq!(
                (cloud.points.as_slice(), cloud.colors.as_slice()),
                (&[[0.001, 0.002, 0.003]][..], &[[10, 20, 30]][..])
            );
        }
        assert!(read_text("1 2 3\n4 5 6 7\n").unwrap().colors.is_empty());
    }

    #[track_caller]
    fn check_refused(text: &str, expected: &str) {
        let message = read_text(text).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}");
    }

    #[test]
    fn what_is_no_point_is_refused_with_its_line() {
        check_refused("1 2 3\n1 2\n", "line 2: 2 values");
        check_refused("1 2 3\n\n1 x 3\n", "line 3: \"x\" is not a number");
        check_refused("1 nan 3\n", "\"nan\" is not a number");
        check_refused("1 inf 3\n", "\"inf\" is not a number");
        check_refused("1 2 1e300\n", "point 1");
        check_refused("1 2 3 256 0 0\n", "\"256\" is not a colour");
        check_refused("# nothing\n", "no point");
        check_refused("1000000000\n", "1000000000 points");
        check_refused(&"1".repeat(5000), "longer than 1024");
    }

    #[test]
    fn the_limit_holds() {
        let limits = Limits { max_points: 2, ..Limits::default() };
        assert!(read(&b"1 2 3\n1 2 3\n"[..], &limits).is_ok());
        assert!(matches!(
            read(&b"1 2 3\n1 2 3\n1 2 3\n"[..], &limits),
            Err(ModelError::TooMany { found: 3, .. })
        ));
    }
}
