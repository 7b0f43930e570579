//! The CSV lines of all programs of the comparison.

use std::path::Path;

use anyhow::Context;

/// One measured stage of one program.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    pub(crate) peer: String,
    pub(crate) stage: String,
    pub(crate) threads: usize,
    pub(crate) wall_min_ms: f64,
    pub(crate) cpu_ms: f64,
    /// What else is known: numbers of points, quality.
    pub(crate) extra: String,
}

impl Row {
    /// `peer,stage,threads,n,wall_median_ms,wall_min,wall_max,cpu_median_ms,peak_rss_mb,extra`; `None` for other lines.
    fn parse(line: &str) -> Option<Self> {
        let mut fields = line.splitn(10, ',');
        let mut text = || fields.next().map(str::trim);
        let (peer, stage, threads, _) = (text()?, text()?, text()?, text()?);
        let (median, low, _, cpu, _) = (text()?, text()?, text()?, text()?, text()?);
        // What was run once has no least time of its own.
        let low = if low.is_empty() { median } else { low };
        Some(Self {
            peer: peer.to_owned(),
            stage: stage.to_owned(),
            threads: threads.parse().ok()?,
            wall_min_ms: low.parse().ok()?,
            cpu_ms: cpu.parse().ok()?,
            extra: text().unwrap_or_default().to_owned(),
        })
    }

    pub(crate) fn is_ours(&self) -> bool {
        self.peer.starts_with("allround")
    }

    /// A value of the last column, `name=value`.
    pub(crate) fn said(&self, name: &str) -> Option<&str> {
        self.extra.split_whitespace().find_map(|word| word.strip_prefix(name)?.strip_prefix('='))
    }
}

/// All lines of some files that are rows.
pub(crate) fn read(files: &[impl AsRef<Path>]) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for file in files {
        let file = file.as_ref();
        let text = std::fs::read_to_string(file).with_context(|| file.display().to_string())?;
        rows.extend(text.lines().filter(|line| !line.starts_with('#')).filter_map(Row::parse));
    }
    Ok(rows)
}

/// Whether a peer's stage does what ours does on the same input.
pub(crate) fn is_same(ours: &str, peers: &str) -> bool {
    let tags = |family: &str| ours == format!("{family} detect") && peers.starts_with(family);
    let volume = |name: &str| ours.starts_with(name) && peers.starts_with(name);
    // Some peers know text by the name .xyz alone; the file is a copy. Others find neighbours within both bounds at once.
    let text = |name: &str| name.replace(".xyz", ".asc");
    let hybrid = |name: &str| {
        name.replace("normals hybrid r10mm/30", "normals r10mm")
            .replace("fpfh hybrid r25mm/100", "fpfh r25mm")
    };
    // The peer's own recipe for eight views; "all" pairs are slower and less true.
    let views = || {
        let of = peers.strip_prefix("8-view recon ")?.strip_suffix(" adjacent vs2mm")?;
        Some(ours.strip_prefix("8-view build ")? == of)
    };
    // The peers' runs on all 64 pairs at 45 degrees.
    let global =
        ["global RANSAC mutual 100k", "global RANSAC nomutual 100k", "global FGR", "global FGR 7.5mm"];
    ours == peers
        || views() == Some(true)
        || (ours.starts_with("global verified 45deg") && global.contains(&peers))
        || text(ours) == text(peers)
        || ours == hybrid(peers)
        || volume("tsdf integrate")
        || volume("tsdf mesh")
        || tags("ARUCO 4x4_50")
        || tags("AprilTag 36h11")
}
