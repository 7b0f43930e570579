//! What the program says to people and to machines.
//!
//! Results go to standard output (words, or one JSON object with `--json`); progress, notes and warnings go to standard
//! error: bars with stage and remaining time on a terminal, plain lines otherwise, JSON lines with `--json`.

use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

/// Follows work that somebody else shows: the stages as they begin, their steps, and whether to go on.
pub trait Listener: Send + Sync + std::fmt::Debug {
    /// A stage of `total` steps begins.
    fn stage(&self, name: &str, total: usize);

    /// Steps of the present stage were done.
    fn advanced(&self, steps: u64);

    /// Whether the work is still wanted.
    fn is_wanted(&self) -> bool;
}

/// How to speak.
#[derive(Debug, Clone)]
pub struct Ui {
    json: bool,
    quiet: bool,
    verbose: bool,
    terminal: bool,
    color: bool,
    results: bool,
    listener: Option<Arc<dyn Listener>>,
}

/// One stage of work in progress; may be shared between threads.
#[derive(Debug)]
pub struct Stage {
    name: String,
    bar: Option<ProgressBar>,
    started: Instant,
    ui: Ui,
}

impl Ui {
    /// Decides by the flags, by `NO_COLOR` and by whether standard error is a terminal.
    pub fn new(json: bool, quiet: bool, verbose: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let color = terminal && std::env::var_os("NO_COLOR").is_none_or(|v| v.is_empty());
        Self { json, quiet, verbose, terminal, color, results: true, listener: None }
    }

    /// A voice that says nothing, for tests and for use as a library.
    pub fn silent() -> Self {
        Self {
            json: false,
            quiet: true,
            verbose: false,
            terminal: false,
            color: false,
            results: false,
            listener: None,
        }
    }

    /// A voice that says nothing but lets `listener` follow the stages.
    pub fn followed_by(listener: Arc<dyn Listener>) -> Self {
        Self { listener: Some(listener), ..Self::silent() }
    }

    /// Whether the work is still wanted; asked between stages.
    pub fn is_wanted(&self) -> bool {
        self.listener.as_ref().is_none_or(|listener| listener.is_wanted())
    }

    /// The same voice for a part of a larger work: no result of its own on standard output.
    pub fn quieter(&self) -> Self {
        Self { results: false, ..self.clone() }
    }

    /// Whether results are to be JSON.
    pub fn is_json(&self) -> bool {
        self.json
    }

    /// A note; silent with `--quiet`.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            self.say("note", text, text);
        }
    }

    /// Detail for the curious; only with `--verbose`.
    pub fn detail(&self, text: &str) {
        if self.verbose {
            self.say("detail", text, text);
        }
    }

    /// A warning: always said.
    pub fn warn(&self, text: &str) {
        let painted =
            if self.color { format!("\x1b[33mwarning:\x1b[0m {text}") } else { format!("warning: {text}") };
        self.say("warning", text, &painted);
    }

    /// The error the program ends with.
    pub fn error(&self, text: &str) {
        let painted =
            if self.color { format!("\x1b[31merror:\x1b[0m {text}") } else { format!("error: {text}") };
        self.say("error", text, &painted);
    }

    /// The result: one JSON object on standard output, or the words for people.
    pub fn result(&self, words: &str, machine: &Value) {
        if !self.results {
            return;
        }
        let mut out = std::io::stdout().lock();
        // A closed pipe is the reader's choice, not an error of ours.
        let _ = if self.json { writeln!(out, "{machine}") } else { writeln!(out, "{}", words.trim_end()) };
    }

    /// Begins a stage of `total` steps.
    pub fn stage(&self, name: &str, total: usize) -> Stage {
        let bar = (self.terminal && !self.quiet && !self.json).then(|| {
            let bar = ProgressBar::new(total as u64);
            let template = "{msg:28} {bar:24} {pos}/{len}  {elapsed} passed, {eta} left";
            if let Ok(style) = ProgressStyle::with_template(template) {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_message(name.to_string());
            bar.enable_steady_tick(Duration::from_millis(200));
            bar
        });
        if self.json && !self.quiet {
            print_event(&json!({"event": "stage", "name": name, "steps": total}));
        }
        if let Some(listener) = &self.listener {
            listener.stage(name, total);
        }
        Stage { name: name.to_string(), bar, started: Instant::now(), ui: self.clone() }
    }

    fn say(&self, kind: &str, text: &str, painted: &str) {
        if self.json { print_event(&json!({"event": kind, "text": text})) } else { print_line(painted) }
    }
}

fn print_event(event: &Value) {
    print_line(&event.to_string());
}

fn print_line(text: &str) {
    // Standard error that nobody reads is no reason to stop.
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

impl Stage {
    /// One more step is done.
    pub fn step(&self) {
        self.advance(1);
    }

    /// `steps` more steps are done.
    pub fn advance(&self, steps: u64) {
        if let Some(bar) = &self.bar {
            bar.inc(steps);
        }
        if let Some(listener) = &self.ui.listener {
            listener.advanced(steps);
        }
    }

    /// The stage is done; returns how long it took.
    pub fn done(self) -> Duration {
        let took = self.started.elapsed();
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        let millis = took.as_millis();
        if self.ui.json && !self.ui.quiet {
            print_event(&json!({"event": "stage_done", "name": self.name, "millis": millis}));
        } else if !self.ui.quiet {
            print_line(&format!("{:28} {millis:>6} ms", self.name));
        }
        took
    }
}
