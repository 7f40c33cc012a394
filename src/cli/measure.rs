//! What measures and tries: `report` and `torture`.

use super::choices::IntegratorArg;
use super::values::{resolution, seconds};
use crate::load::{LoadError, SceneSource};
use crate::open::Wishes;
use crate::report::{GivenReference, ReportJob};
use clap::Args;
use glam::UVec2;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Arguments of `report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Scenes to measure [default: cornell-point cornell bust]
    #[arg(value_name = "SCENES")]
    pub scenes: Vec<String>,
    /// Folder to write index.html, report.md, .csv, .json and pictures to; references are kept there too
    #[arg(long, value_name = "DIR", default_value = "report")]
    pub out: PathBuf,
    /// Under a minute in all: smaller pictures, shorter times
    #[arg(long)]
    pub quick: bool,
    /// Measure this model in place of our owl, as third of the default scenes
    #[arg(long, value_name = "FILE", conflicts_with = "scenes")]
    pub monkey: Option<String>,
    /// Size of the pictures [default: 256x256, 96x96 with --quick]
    #[arg(long, value_name = "WxH", value_parser = resolution)]
    pub resolution: Option<UVec2>,
    /// direct or path, whatever the scenes say
    #[arg(long, value_enum)]
    pub integrator: Option<IntegratorArg>,
    /// Most bounces from eye to light
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Runs of each method, with different noise
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    pub seeds: u32,
    /// Converged picture (.exr) or film of a seed of its own to measure errors against, instead of making one; of which
    /// scene, if there are several
    #[arg(long, value_name = "[SCENE=]FILE")]
    pub reference: Vec<String>,
    /// Seconds to take in all [default: 510, 45 with --quick; at most a third of it for a scene]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub time: Option<Duration>,
    /// Threads to trace with; 0 = all
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// No progress on standard error
    #[arg(short, long)]
    pub quiet: bool,
}

impl ReportArgs {
    /// What to measure.
    ///
    /// # Errors
    /// If a scene is neither a file nor built in.
    pub fn job(&self, interrupt: Arc<AtomicBool>) -> Result<ReportJob, LoadError> {
        let monkey = self.monkey.as_deref().unwrap_or("bust");
        let names: Vec<&str> = if self.scenes.is_empty() {
            vec!["cornell-point", "cornell", monkey]
        } else {
            self.scenes.iter().map(String::as_str).collect()
        };
        let (size, total) = if self.quick { (96, 45) } else { (256, 510) };
        Ok(ReportJob {
            scenes: names.into_iter().map(SceneSource::parse).collect::<Result<_, _>>()?,
            wishes: Wishes {
                size: Some(self.resolution.unwrap_or(UVec2::splat(size))),
                integrator: self.integrator.map(Into::into),
                max_depth: self.max_depth,
                ..Wishes::default()
            },
            seeds: self.seeds,
            total: self.time.unwrap_or(Duration::from_secs(total)),
            references: self.reference.iter().map(|text| GivenReference::parse(text)).collect(),
            folder: self.out.clone(),
            interrupt,
        })
    }
}

/// Arguments of `torture`.
#[derive(Debug, Args)]
pub struct TortureArgs {
    /// Only this case, such as G1 (may be given several times) [default: all]
    #[arg(long, value_name = "ID")]
    pub case: Vec<String>,
    /// For hours: 10^9 rays, 10^8 samples
    #[arg(long)]
    pub long: bool,
    /// For a minute or so: fewer rays and samples
    #[arg(long, conflicts_with = "long")]
    pub quick: bool,
    /// Another seed, other rays
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Name the cases and what must hold
    #[arg(long)]
    pub list: bool,
    /// Look at the scene of this case, such as G1, in the window or, without a display, as a picture
    #[arg(long, value_name = "ID", conflicts_with = "case")]
    pub show: Option<String>,
    /// Show what it looks like when it breaks
    #[arg(long, requires = "show")]
    pub open_edge: bool,
    /// Print every check as JSON
    #[arg(long)]
    pub json: bool,
    /// Print the table as Markdown
    #[arg(long, conflicts_with = "json")]
    pub markdown: bool,
    /// Threads to use; 0 = all
    #[arg(short, long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// No progress on standard error
    #[arg(short, long)]
    pub quiet: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::measure::MOMENTS;
    use crate::report::methods::{company, methods};
    use crate::report::plan::Plan;
    use crate::trace::Integrator;
    use clap::Parser;

    /// What a run takes beside its tracing, with what belongs to its scene: 0.42 s as measured on two busy cores.
    const BESIDE: f64 = 0.45;

    #[derive(Parser)]
    struct Parsed {
        #[command(flatten)]
        report: ReportArgs,
    }

    fn job(arguments: &[&str]) -> ReportJob {
        Parsed::parse_from(arguments).report.job(Arc::default()).unwrap()
    }

    #[test]
    fn by_default_the_table_s_moments_are_reached_in_ten_minutes() {
        let job = job(&["penumbra"]);
        for integrator in [Integrator::Direct, Integrator::Path] {
            // With all methods that there are, also those that make no difference in most scenes.
            let company = company(methods(integrator, None));
            let plan = Plan::new(job.total, job.scenes.len(), company, job.seeds);
            let longest = MOMENTS.into_iter().fold(0.0, f64::max);
            assert!(plan.ours.first > longest, "the table's {longest} seconds are measured: {plan:?}");
            assert!(plan.other.first > MOMENTS[1], "{plan:?}");
            // "RMSE after 1 s" is of all seeds, but where there are more methods than the default scenes have.
            let least = if integrator == Integrator::Direct { 1.0 } else { 0.9 };
            assert!(plan.ablation.again > least * MOMENTS[0] * 0.9, "{plan:?}");
            let runs = (1 + company.others + company.ablations) as f64 * f64::from(job.seeds);
            let whole = job.scenes.len() as f64 * (plan.seconds(company) + BESIDE * runs);
            assert!(whole < 600.0, "{whole} s: {plan:?}");
        }
    }

    #[test]
    fn a_quick_report_takes_less_than_a_minute() {
        let job = job(&["penumbra", "--quick"]);
        let company = company(methods(Integrator::Path, None));
        let plan = Plan::new(job.total, job.scenes.len(), company, job.seeds);
        let runs = (1 + company.others + company.ablations) as f64 * f64::from(job.seeds);
        // The pictures have a seventh of the pixels; what a pass takes too long is shorter with them.
        let whole = job.scenes.len() as f64 * (plan.seconds(company) + BESIDE / 7.0 * runs);
        assert!(whole < 60.0, "{whole} s: {plan:?}");
        assert!(plan.ours.first > MOMENTS[0] && plan.ablation.again > 0.05, "{plan:?}");
    }
}
