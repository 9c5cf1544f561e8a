//! The command line of a family of commands, such as `recon build` and `recon picks`: the program's name, its commands, and how
//! much it logs.

/// Defines `Arguments`, the command line of a family: `family_arguments!("recon", Command)` below the family's description, where
/// `Command` is the `clap::Subcommand` of its commands.
#[macro_export]
macro_rules! family_arguments {
    ($(#[$description:meta])* $name:literal, $command:ty) => {
        $(#[$description])*
        #[derive(clap::Parser)]
        #[command(name = $name, version, max_term_width = 110)]
        pub struct Arguments {
            #[command(subcommand)]
            command: $command,
            /// Log more (-v, -vv; -vvv: everything, with the output of the video libraries).
            #[arg(short, long, global = true, action = clap::ArgAction::Count, display_order = 1000)]
            verbose: u8,
        }
    };
}
