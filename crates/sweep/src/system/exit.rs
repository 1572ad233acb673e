//! Exit codes of the program: a promise to scripts and schedulers.

/// Everything asked for was done.
pub const DONE: u8 = 0;
/// The work was done, but some cases failed, or a computation asked for by itself did.
pub const FAILED: u8 = 1;
/// Bad input: nothing was computed and nothing was written.
pub const BAD_INPUT: u8 = 2;
/// The store failed (disk full, lock held, file gone, damage met under way), or the output could not be written: finished
/// results stay, and the same command goes on once the cause is gone.
pub const STORE: u8 = 3;

/// The time given to a run was up, and work is left: the same command goes on where it stopped.
pub const TIME_LIMIT: u8 = 4;

/// Stopped by a signal after a checkpoint: the same command goes on where it stopped.
///
/// 128 + the number of the signal, as a shell would say: 129 HUP, 130 INT, 138 USR1, 143 TERM.
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
