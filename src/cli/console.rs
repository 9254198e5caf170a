//! Progress on the terminal, stage times, and the interrupt key.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use screenmill::progress::Progress;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Folders that hold unfinished outputs, and such files.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// How long a stage may take to notice an interrupt before the program ends without it.
const PATIENCE: Duration = Duration::from_secs(2);

/// Ctrl-C and a polite kill end the work at the next safe place, and after two seconds wherever it is;
/// unfinished outputs are removed either way.
pub fn listen_for_interrupt() -> Result<(), ctrlc::Error> {
    // A file that grows past `ulimit -f` is a disk that is full, told and cleaned up, and no reason to be killed.
    // A polite kill is taken as Ctrl-C; ctrlc's own way would also undo `nohup`.
    #[cfg(target_os = "linux")]
    // SAFETY: nothing else in the program handles these signals; ignoring one runs no code, and raise may be
    // called in a handler.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
        libc::signal(libc::SIGTERM, interrupt as *const () as libc::sighandler_t);
    }
    ctrlc::set_handler(|| {
        INTERRUPTED.store(true, Ordering::SeqCst);
        std::thread::sleep(PATIENCE);
        for path in UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
            // What cannot be removed keeps its hidden name.
            let _ = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
        }
        eprintln!("error: {}", screenmill::pipeline::Error::Interrupted);
        std::process::exit(2);
    })
}

#[cfg(target_os = "linux")]
extern "C" fn interrupt(_signal: libc::c_int) {
    // SAFETY: raise is safe in a handler.
    unsafe {
        libc::raise(libc::SIGINT);
    }
}

/// Whether the work should end at the next safe place.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// Has a folder or a file removed if the program is interrupted, until [`finished`].
pub fn unfinished(path: &Path) {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_path_buf());
}

/// Leaves a folder alone again.
pub fn finished(folder: &Path) {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner).retain(|known| known != folder);
}

struct Stage {
    name: String,
    started: Instant,
    bar: ProgressBar,
}

#[derive(Default)]
struct State {
    running: Option<Stage>,
    done: Vec<(String, Duration)>,
}

/// A progress bar on a terminal, plain lines elsewhere, nothing if quiet; keeps each stage's time.
pub struct Console {
    state: Mutex<State>,
    quiet: bool,
    verbose: bool,
    terminal: bool,
    started: Instant,
}

impl Console {
    pub fn new(quiet: bool, verbose: bool) -> Console {
        Console {
            state: Mutex::new(State::default()),
            quiet,
            verbose,
            terminal: std::io::stderr().is_terminal(),
            started: Instant::now(),
        }
    }

    /// Time since the command began.
    pub fn wall(&self) -> Duration {
        self.started.elapsed()
    }

    /// Ends the running stage and gives every stage's time in order; a stage that ran more than
    /// once is summed.
    pub fn times(&self) -> Vec<(String, Duration)> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        self.finish(&mut state);
        let mut summed: Vec<(String, Duration)> = Vec::new();
        for (name, time) in &state.done {
            match summed.iter_mut().find(|(other, _)| other == name) {
                Some(entry) => entry.1 += *time,
                None => summed.push((name.clone(), *time)),
            }
        }
        summed
    }

    fn finish(&self, state: &mut State) {
        if let Some(stage) = state.running.take() {
            let time = stage.started.elapsed();
            stage.bar.finish_and_clear();
            if self.verbose {
                eprintln!("{}: {:.2} s", stage.name, time.as_secs_f64());
            }
            state.done.push((stage.name, time));
        }
    }
}

impl Progress for Console {
    fn begin(&self, stage: &str, total: u64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        self.finish(&mut state);
        let bar = if self.quiet || !self.terminal {
            ProgressBar::hidden()
        } else {
            let style = ProgressStyle::with_template("{msg:32} {bar:40} {percent:>3} % {eta:>5}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::new(total).with_style(style).with_message(stage.to_string())
        };
        if !self.quiet && !self.terminal {
            eprintln!("{stage} ...");
        }
        state.running = Some(Stage { name: stage.to_string(), started: Instant::now(), bar });
    }

    fn advance(&self, steps: u64) {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(stage) = &state.running {
            stage.bar.inc(steps);
        }
    }

    fn interrupted(&self) -> bool {
        interrupted()
    }
}
