//! Exit codes of the program, a stable interface for scripts and schedulers.

/// Everything requested was done.
pub const DONE: u8 = 0;
/// The work was done, but some cases or the requested computation failed.
pub const FAILED: u8 = 1;
/// Bad input: nothing was computed and nothing was written.
pub const BAD_INPUT: u8 = 2;
/// The store failed (disk full, lock held, file gone, damage found), or the output could not be
/// written: finished results stay, and the same command continues once the cause is removed.
pub const STORE: u8 = 3;

/// The time limit was reached with work left: the same command continues.
pub const TIME_LIMIT: u8 = 4;

/// Stopped by a signal after a checkpoint: the same command continues.
///
/// 128 + the number of the signal, as in shells: 129 HUP, 130 INT, 138 USR1, 143 TERM.
pub const fn stopped_by(signal: i32) -> u8 {
    128_u8.wrapping_add(signal.to_le_bytes()[0])
}

#[cfg(test)]
mod tests {
    use super::stopped_by;

    #[test]
    fn codes_of_the_signals_are_those_of_the_shell() {
        assert_eq!(stopped_by(2), 130);
        assert_eq!(stopped_by(15), 143);
    }
}
