//! `compare`.

use crate::exit;
use crate::print::line;
use penumbra::cli::CompareArgs;
use penumbra::reference::compare;

/// Says how much two pictures differ.
pub fn run(args: &CompareArgs) -> u8 {
    let (difference, shared) = match compare(&args.a, &args.b) {
        Ok(compared) => compared,
        Err(error) => return exit::because(&error, exit::FAILED),
    };
    if let Some(shared) = shared {
        eprintln!("warning: {shared}");
    }
    if args.json {
        match serde_json::to_string(&difference) {
            Ok(json) => line(json),
            Err(error) => return exit::because(&error, exit::FAILED),
        }
    } else {
        let [x, y] = difference.max_at;
        line(format_args!("RMSE      {:.6e}", difference.rmse));
        line(format_args!("relMSE    {:.6e}", difference.relative_mse));
        line(format_args!("max error {:.6e} at pixel {x},{y}", difference.max_error));
        line(format_args!("mean      {:+.6e}", difference.bias));
        if difference.not_finite > 0 {
            line(format_args!("{} values are not finite and were left out", difference.not_finite));
        }
    }
    let failed = |limit: f64| difference.not_finite > 0 || difference.rmse > limit;
    if args.fail_above.is_some_and(failed) { exit::ABOVE_LIMIT } else { 0 }
}
