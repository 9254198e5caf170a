use std::process::ExitCode;

mod cli;

fn main() -> ExitCode {
    // A reader that has seen enough (`| head`) ends the program, it does not make it panic.
    sigpipe::reset();
    screenmill::memory::keep_freed();
    cli::run()
}
